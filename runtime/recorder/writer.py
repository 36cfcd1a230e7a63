"""The recorder: samples into an MCAP file that a killed process leaves readable up to the last 0.25 s."""

from __future__ import annotations

import contextlib
import os
import threading
from pathlib import Path
from types import TracebackType

from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer

from runtime.errors import PushlaneError
from runtime.recorder.header import CONFIG_NAME, METADATA_NAME, Header
from runtime.recorder.schema import descriptor_set, message_type
from runtime.recorder.viewer import ViewerChannels
from runtime.sample import Sample

FLUSH_PERIOD = 0.2
"""s between chunk closings; with the time one takes, a kill loses at most 0.25 s."""


class CannotRecord(PushlaneError):
    """The file cannot be written."""


class Recorder:
    """Writes samples to `path` until closed. Use as a context manager.

    A thread closes the open chunk and writes it to disk every `FLUSH_PERIOD`, also when nothing new comes.

    Args:
        path: a new file.
        header: written first, so that a cut file still says what it is.
        config: the effective configuration as JSON.
        overwrite: replace a file that is there; otherwise it is left alone.

    Raises:
        CannotRecord: the file cannot be opened, or is there already.
    """

    def __init__(self, path: Path, header: Header, config: bytes, overwrite: bool = False) -> None:
        self.path = path
        self.count = 0
        try:
            self._file = path.open("wb" if overwrite else "xb")
        except FileExistsError as error:
            raise CannotRecord(f"{path} is there already: choose another name, or say --overwrite") from error
        except OSError as error:
            raise self._cannot(error) from error
        self._failure: OSError | None = None
        self._writer = Writer(self._file, compression=CompressionType.ZSTD, enable_data_crcs=True)
        try:
            self._writer.start(profile="", library="pushlane")
            self._writer.add_metadata(METADATA_NAME, header.metadata())
            self._writer.add_attachment(0, 0, CONFIG_NAME, "application/json", config)
            self._file.flush()
        except OSError as error:
            self._abandon()
            raise self._cannot(error) from error
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
            if self._failure is not None:
                raise self._cannot(self._failure)
            try:
                channel = self._channels.get(sample.topic) or self._register(sample.topic)
                self._writer.add_message(channel, sample.time, sample.payload, sample.time, sample.sequence)
                self._viewer.add(sample)
            except OSError as error:
                self._failure = error
                raise self._cannot(error) from error
            self.count += 1

    def note(self, name: str, pairs: dict[str, str]) -> None:
        """Write facts about the recording itself, as the metadata record `name`.

        Raises:
            CannotRecord: the disk is full, or the like.
        """
        with self._lock:
            try:
                self._writer.add_metadata(name, pairs)
            except OSError as error:
                self._failure = error
                raise self._cannot(error) from error

    def close(self) -> None:
        """Write what is left, the index and the end of the file.

        Raises:
            CannotRecord: that could not be written, or something before it could not.
        """
        if self._closing.is_set():
            return
        self._closing.set()
        self._thread.join()
        with self._lock:
            try:
                if self._failure is not None:
                    raise self._failure
                self._writer.finish()
                self._file.flush()
                os.fsync(self._file.fileno())
                self._file.close()
            except OSError as error:
                self._abandon()
                raise self._cannot(error) from error

    def _abandon(self) -> None:
        """Close the file without writing what is still buffered: that has failed already."""
        with contextlib.suppress(OSError):
            self._file.close()

    def _cannot(self, error: OSError) -> CannotRecord:
        return CannotRecord(f"cannot write {self.path}: {error.strerror or error}")

    def _keep_flushed(self) -> None:
        while not self._closing.wait(FLUSH_PERIOD):
            try:
                with self._lock:
                    self._writer.flush()
                os.fsync(self._file.fileno())
            except OSError as error:
                self._failure = error  # the next sample reports it
                return

    def _register(self, topic: str) -> int:
        kind = message_type(topic)
        name = kind.DESCRIPTOR.full_name
        if name not in self._schemas:
            data = descriptor_set(kind.DESCRIPTOR.file).SerializeToString(deterministic=True)
            self._schemas[name] = self._writer.register_schema(name, SchemaEncoding.Protobuf, data)
        channel = self._writer.register_channel(topic, MessageEncoding.Protobuf, self._schemas[name])
        self._channels[topic] = channel
        return channel
