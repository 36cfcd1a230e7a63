"""The recorder: samples into an MCAP file that a killed process leaves readable up to the last 0.25 s."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from runtime.errors import PushlaneError
from runtime.node import Sample
from runtime.recorder.header import CONFIG_NAME, METADATA_NAME, Header
from runtime.recorder.schema import descriptor_set, message_type
from runtime.recorder.viewer import ViewerChannels

FLUSH_PERIOD = 0.2
"""s between chunk closings; with the time one takes, a kill loses at most 0.25 s."""


class CannotRecord(PushlaneError):
    """The file cannot be written."""


class Recorder:
    """Writes samples to `path` until closed. Use as a context manager.

    A thread closes the open chunk and writes it to disk every `FLUSH_PERIOD`, also when nothing new comes.

    Args:
        path: a new file, or one to overwrite.
        header: written first, so that a cut file still says what it is.
        config: the effective configuration as JSON.

    Raises:
        CannotRecord: the file cannot be opened.
    """

    def __init__(self, path: Path, header: Header, config: bytes) -> None:
        self.path = path
        self.count = 0
        try:
            self._file = path.open("wb")
        except OSError as error:
            raise CannotRecord(f"cannot write {path}: {error.strerror or error}") from error
        self._writer = Writer(self._file, compression=CompressionType.ZSTD, enable_data_crcs=True)
        self._writer.start(profile="", library="pushlane")
        self._writer.add_metadata(METADATA_NAME, header.metadata())
        self._writer.add_attachment(0, 0, CONFIG_NAME, "application/json", config)
        self._file.flush()
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._viewer = ViewerChannels(self._writer)
        self._lock = threading.Lock()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._keep_flushed, name="recorder", daemon=True)
        self._thread.start()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __call__(self, sample: Sample) -> None:
        """Write one sample.

        Raises:
            CannotRecord: the disk is full, or the like.
        """
        with self._lock:
            channel = self._channels.get(sample.topic) or self._register(sample.topic)
            self._guarded(
                lambda: self._writer.add_message(channel, sample.time, sample.payload, sample.time, sample.sequence)
            )
            self.count += 1
            self._viewer.add(sample)

    def close(self) -> None:
        """Write what is left, the index and the end of the file."""
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        with self._lock:
            try:
                self._guarded(self._finish)
            finally:
                self._file.close()

    def _finish(self) -> None:
        self._writer.finish()
        self._file.flush()
        os.fsync(self._file.fileno())

    def _keep_flushed(self) -> None:
        while not self._closing.wait(FLUSH_PERIOD):
            with self._lock:
                try:
                    self._writer.flush()
                except OSError:
                    return  # the next sample meets the same error and reports it
            os.fsync(self._file.fileno())

    def _guarded(self, work: Callable[[], Any]) -> None:
        try:
            work()
        except OSError as error:
            raise CannotRecord(f"cannot write {self.path}: {error.strerror or error}") from error

    def _register(self, topic: str) -> int:
        kind = message_type(topic)
        name = kind.DESCRIPTOR.full_name
        if name not in self._schemas:
            data = descriptor_set(kind.DESCRIPTOR.file).SerializeToString(deterministic=True)
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.Protobuf, data)
        channel = self._writer.register_channel(topic, MessageEncoding.Protobuf, self._schemas[name])
        self._channels[topic] = channel
        return channel
