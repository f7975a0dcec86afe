"""Counts of what kernels do: from LLVM code that is written here, from kernels whose text says it, and on the page."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import ceilings
import operation_counts
import pytest
import roofline
import roofline_page

from sarcl import NoDeviceError
from sarcl.opencl.choose_device import open_device

ROOT = Path(__file__).parents[2]
RECORDED = json.loads((ROOT / "bench" / "results" / "trials" / "roofline.json").read_text())

INSTRUCTIONS = [
    ("%x = fadd fast <8 x float> %a, %b", {"operations32": 8, "instructions": 1}),
    ("%x = fmul double %a, %b", {"operations64": 1, "instructions": 1}),
    ("%x = fadd <16 x double> %a, %b", {"operations64": 16, "instructions": 2}),
    ("%x = fdiv <4 x float> %a, %b", {"operations32": 4, "divisions32": 4, "instructions": 1}),
    (
        "%x = tail call fast <8 x float> @llvm.fma.v8f32(<8 x float> %a, <8 x float> %b, <8 x float> %c)",
        {"operations32": 16, "instructions": 1},
    ),
    ("%x = call double @llvm.sqrt.f64(double %a)", {"operations64": 1, "divisions64": 1, "instructions": 1}),
    (
        "%x = call float @llvm.vector.reduce.fadd.v8f32(float 0.0, <8 x float> %a)",
        {"operations32": 8, "instructions": 1},
    ),
    ("%x = call <8 x float> @llvm.x86.avx.max.ps.256(<8 x float> %a, <8 x float> %b)", {"instructions": 1}),
    ("%x = fcmp olt <8 x float> %a, %b", {"instructions": 1}),
    ("%x = load <8 x float>, ptr %p, align 4", {"bytes": 32, "instructions": 1}),
    ("store double %a, ptr %p, align 8", {"bytes": 8, "instructions": 1}),
    (
        "%x = call <8 x float> @llvm.masked.gather.v8f32.v8p0(<8 x ptr> %p, i32 4, <8 x i1> %m, <8 x float> %a)",
        {"bytes": 32, "instructions": 8},
    ),
    ("call void @llvm.memcpy.p0.p0.i64(ptr %a, ptr %b, i64 96, i1 false)", {"bytes": 192, "instructions": 2}),
    ("%x = add nsw i32 %a, 1", {"instructions": 1}),
    ("br i1 %c, label %a, label %b", {"instructions": 1}),
    ("br label %a", {}),
    ("%x = insertelement <8 x float> poison, float %a, i64 0", {}),
    ("%x = insertelement <8 x float> %b, float %a, i64 0", {"instructions": 1}),
    ("%x = shufflevector <8 x float> %a, <8 x float> poison, <8 x i32> zeroinitializer", {}),
    ("%x = shufflevector <8 x float> %a, <8 x float> %b, <2 x i32> <i32 0, i32 9>", {"instructions": 1}),
    ("%x = getelementptr inbounds float, ptr %p, i64 2", {}),
    ("%x = tail call fastcc float @own(float %a)", {"instructions": 1}),
]

# A loop of %n rounds: entry, loop with phi, exit by a switch whose list is no instruction
CODE = """define float @own(i32 %n) {
  %a = fadd float 1.0, 2.0
  br label %loop

loop:                                             ; preds = %0, %loop
  %i = phi i32 [ 0, %0 ], [ %next, %loop ]
  %s = phi float [ %a, %0 ], [ %t, %loop ]
  %t = fmul float %s, %s
  %next = add i32 %i, 1
  %more = icmp slt i32 %next, %n
  br i1 %more, label %loop, label %exit

exit:                                             ; preds = %loop
  switch i32 %n, label %end [
    i32 1, label %end
    i32 2, label %end
  ]

end:
  ret float %t
}
"""


@pytest.mark.parametrize(("line", "wanted"), INSTRUCTIONS)
def test_an_instruction_counts_by_its_lanes_bytes_and_registers(line, wanted):
    assert operation_counts.quantities(line, {"own"}) == wanted


def test_a_function_whose_work_is_unknown_is_refused():
    with pytest.raises(operation_counts.NotCounted, match="sinf"):
        operation_counts.quantities("%x = call float @sinf(float %a)", {"own"})


def test_every_block_is_counted_after_its_phis_and_lists_of_switches_are_no_instructions():
    text, blocks = operation_counts.with_counters(CODE)
    lines = text.splitlines()
    assert lines[-1] == "@sarcl_block_counts = global [4 x i64] zeroinitializer"
    places = [n for n, line in enumerate(lines) if "atomicrmw" in line]
    assert [lines[n + 1].split()[0] for n in places] == ["%a", "%t", "switch", "ret"]
    assert [(block["operations32"], block["instructions"]) for block in blocks] == [(1, 1), (1, 4), (0, 1), (0, 0)]


def test_recorded_counts_are_those_of_the_formulas():
    """Yee's updates: nine differences and three multiply-adds of each field, (9 + 6) 2 operations per cell and step."""
    rows = {(row["call"], row["kernel"]): row for row in RECORDED["kernels"]}
    steps = [row for (call, _), row in rows.items() if call == "time steps of a large grid" and row["file"]]
    cells = roofline.CELLS**2 * -(-roofline.CELLS // roofline.LANES) * roofline.LANES
    assert sum(row["operations32"] for row in steps) == pytest.approx(30 * cells * roofline.TIME_STEPS, rel=0.02)
    ceilings.verified(RECORDED["kernels"], 8)


@pytest.mark.parametrize("quantity", ["operations32", "bytes"])
def test_counts_that_differ_from_the_text_of_the_ceilings_are_refused(quantity):
    rows = [{**row, quantity: 1.02 * row.get(quantity, 0)} for row in RECORDED["kernels"]]
    with pytest.raises(RuntimeError, match="counts of ceilings are wrong"):
        ceilings.verified(rows, 8)


def test_the_limit_is_the_ceiling_that_would_take_the_longest():
    nothing = dict.fromkeys(("operations32", "operations64", *operation_counts.QUANTITIES, "memory", "launches"), 0.0)
    tops = dict.fromkeys(nothing, 100.0) | {"operations64": 50.0}
    row = {**nothing, "file": "a.cl", "kernel": "a", "call": "one", "cpu_seconds": 2.0, "operations32": 40.0}
    row |= {"operations64": 40.0, "memory": 150.0, "bytes": 10.0}
    assert roofline_page.shares(row, tops)["multiply-adds"] == pytest.approx((0.4 + 0.8) / 2)
    assert roofline_page.nearest(row, tops) == ("memory", 0.75)
    small = {**row, "file": "b.cl", "kernel": "b", "cpu_seconds": 0.1, "memory": 0.1}
    whole = {"call": "one", "file": "", "kernel": "", "cpu_seconds": 10.0}
    document = {"ceilings": tops, "kernels": [whole, small, row], "unused": ["c.cl"]}
    assert [(row["kernel"], row["share"]) for row in roofline_page.kernels(document)] == [("a", 0.2), ("b", 0.01)]
    assert roofline_page.in_kernels(document) == {"one": pytest.approx(0.21)}
    text = "\n".join(roofline_page.section(document, ""))
    assert "| `a` | one | 20% | 8e-05 | 0.00015 | 2e+03 | 75% | memory 75% |" in text
    assert "Below 2% of the CPU seconds of every call: `b` 1 %." in text and "on this device: `c.cl`." in text


@pytest.mark.slow
def test_kernels_of_ceilings_are_counted_as_they_run(tmp_path):
    """roofline.py compares the counts with the text; the roof is that of this device, whatever its LLVM."""
    try:
        operation_counts.clang_of(open_device("cpu").context.devices[0].platform.version)
    except (NoDeviceError, RuntimeError) as exc:
        pytest.skip(str(exc))
    command = [sys.executable, roofline.__file__, "--only", "ceilings", "--rounds", "1", "--json", tmp_path / "a.json"]
    subprocess.run(command, check=True, capture_output=True, timeout=600)
    document = json.loads((tmp_path / "a.json").read_text())
    assert document["ceilings"]["operations32"] > document["ceilings"]["operations64"] > 0
