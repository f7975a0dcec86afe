"""Work-items that a multiprocessor holds at once, as a share of the most it can hold."""

from __future__ import annotations

# NVIDIA, compute capability 8.0 to 12.0: registers, and by target warps, groups and bytes of local memory per
# multiprocessor. Source: CUDA C++ Programming Guide, table "Technical Specifications per Compute Capability".
REGISTERS = 65536
WARPS, GROUPS, LOCAL = (
    dict(zip(("sm_80", "sm_89", "sm_90", "sm_120"), values, strict=True))
    for values in ((64, 48, 64, 48), (32, 24, 32, 24), (164 * 1024, 100 * 1024, 228 * 1024, 100 * 1024))
)
WAVES = {"gfx90a": 8, "gfx1100": 16}  # most waves per SIMD of AMD
DRIVERS_CHOICE = 256  # work-items per group taken for a driver's choice


def warps_of(group: int) -> int:
    """Warps of a group of work-items, 0 where the driver chooses."""
    return -(-(group or DRIVERS_CHOICE) // 32)


def groups(target: str, registers: int, local_memory: int, group: int) -> int:
    """Groups that a multiprocessor holds: limited by registers, local memory, warps and groups."""
    warps = warps_of(group)
    per_warp = -(-max(registers, 1) * 32 // 256) * 256  # registers are given to warps by 256
    most = min(WARPS[target] // warps, GROUPS[target], REGISTERS // per_warp // warps)
    if local_memory:
        most = min(most, LOCAL[target] // (local_memory + 1024))  # the system takes 1 KB of each group's
    return most


def nvidia(target: str, registers: int, local_memory: int, group: int) -> float:
    """Share of the warps that a multiprocessor holds."""
    return groups(target, registers, local_memory, group) * warps_of(group) / WARPS[target]


def amd(target: str, waves: int) -> float:
    """Share of the waves that a SIMD holds, of which the compiler tells the number."""
    return waves / WAVES[target]
