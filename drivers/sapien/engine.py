"""SAPIEN, imported without what it says where the system has no Vulkan: most of what is here draws nothing."""

import warnings

with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message="Failed to find system libvulkan")
    import sapien
    from sapien import physx

__all__ = ["physx", "sapien"]
