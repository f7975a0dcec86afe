"""Work-items that a multiprocessor holds at once, as a share of the most it can hold."""

from __future__ import annotations

# NVIDIA, compute capability 8.0 and 9.0: registers, warps and groups per multiprocessor, bytes of local memory.
# Source: CUDA C++ Programming Guide, table "Technical Specifications per Compute Capability".
REGISTERS, WARPS, GROUPS = 65536, 64, 32
LOCAL = {"sm_80": 164 * 1024, "sm_90": 228 * 1024}
WAVES = {"gfx90a": 8, "gfx1100": 16}  # most waves per SIMD of AMD
DRIVERS_CHOICE = 256  # work-items per group taken for a driver's choice


def nvidia(target: str, registers: int, local_memory: int, group: int) -> float:
    """Share of the warps that a multiprocessor holds: limited by registers, local memory and groups."""
    warps = -(-(group or DRIVERS_CHOICE) // 32)
    per_warp = -(-max(registers, 1) * 32 // 256) * 256  # registers are given to warps by 256
    groups = min(WARPS // warps, GROUPS, REGISTERS // per_warp // warps)
    if local_memory:
        groups = min(groups, LOCAL[target] // (local_memory + 1024))  # the system takes 1 KB of each group's
    return groups * warps / WARPS


def amd(target: str, waves: int) -> float:
    """Share of the waves that a SIMD holds, of which the compiler tells the number."""
    return waves / WAVES[target]
