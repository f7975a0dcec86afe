"""Counting of instructions in listings of NVIDIA's machine code."""

from __future__ import annotations

import pytest
from gpu_static.collect import Variant, kernels_in
from gpu_static.hot_loops import Hot, NotCounted, cost, hot_loop
from gpu_static.sass import code_of, kind, kinds

# A kernel with two outer loops, the first with an inner loop; the branch to itself at the end is padding.
LISTING = """
.text.other:
        /*0000*/                   EXIT ;
\t.section\t.text.kernel_1,"ax",@progbits
.text.kernel_1:
        .type           kernel_1,@function
kernel_1:
        /*0000*/                   LDC R1, c[0x0][0x28] ;
.L_x_4:
        /*0010*/                   LDG.E.CONSTANT R67, desc[UR16][R10.64+0x8] ;
        /*0020*/              @!P3 BRA `(.L_x_2) ;
.L_x_3:
        /*0030*/                   FFMA R3, R22, R22, R3 ;
        /*0040*/                   DFMA R4, R22, R22, R4 ;
        /*0050*/                   MUFU.RCP R4, R22 ;
        /*0060*/               @P1 BRA `(.L_x_3) ;
.L_x_2:
        /*0070*/                   BAR.SYNC.DEFER_BLOCKING 0x0 ;
        /*0080*/              @!P0 BRA `(.L_x_4) ;
.L_x_6:
        /*0090*/                   STS.64 [R4], R6 ;
        /*00a0*/              @!P0 BRA `(.L_x_6) ;
        /*00b0*/                   EXIT ;
.L_x_5:
        /*00c0*/                   BRA `(.L_x_5);
"""


def test_loops_are_found_by_their_branches_back():
    code = code_of(LISTING, "kernel_1")
    assert len(code.opcodes) == 13
    assert [(loop.first, loop.last) for loop in code.loops] == [(1, 8), (9, 10)]
    assert [(loop.first, loop.last) for loop in code.loops[0].inside] == [(3, 6)]
    assert len(code.own(code.loops[0])) == 4
    assert [(loop.first, loop.last) for loop in code.every_loop()] == [(1, 8), (3, 6), (9, 10)]
    assert code_of(LISTING, "other").opcodes == ["EXIT"]
    with pytest.raises(ValueError, match="kernel nothing is not in the listing"):
        code_of(LISTING, "nothing")


@pytest.mark.parametrize(
    "opcode, wanted",
    [("DFMA", "fp64"), ("F2F.F64.F32", "fp64 conversion"), ("I2F.F64", "fp64 conversion"), ("F2I.NTZ", "integer"),
     ("FFMA.FTZ", "fp32"), ("MUFU.SIN", "special function"), ("LDG.E.64.CONSTANT", "load global"),
     ("LDS.128", "load local memory"), ("STL", "store stack"), ("ULDC.64", "constant"), ("UIADD3", "integer"),
     ("BSSY", "branch"), ("BAR.SYNC", "barrier")],
)  # fmt: skip
def test_kinds_of_instructions(opcode, wanted):
    assert kind(opcode) == wanted


def test_the_hot_loop_is_the_largest_innermost_one_or_that_of_a_work_group():
    code = code_of(LISTING, "kernel_1")
    innermost, barrier = hot_loop(code, "innermost"), hot_loop(code, "barrier")
    assert (innermost.first, innermost.last, barrier.first, barrier.last) == (3, 6, 1, 8)


def test_cost_counts_each_trip_of_the_loops_inside():
    code = code_of(LISTING, "kernel_1")
    made = cost(code, Hot("PIXELS", "pair", loop="barrier", trips=("TAPS / 2",)), {"PIXELS": 16, "TAPS": 6})
    assert made.trip == 4 + 3 * 4 and made.each == 1.0
    assert made.by_kind == {
        "load global": 1,
        "branch": 2 + 3,
        "barrier": 1,
        "fp32": 3,
        "fp64": 3,
        "special function": 3,
    }
    assert cost(code, Hot("VW", "pair"), {"VW": 2}).each == 2.0
    assert cost(code, None, {}).trip == 4
    assert cost(code_of(LISTING, "other"), None, {}).unit == "work-item"


# A loop whose work-items take one of two sides of 64 and 66 instructions, with a short side before them.
SIDES = "\n".join(
    [".text.sides:", ".L_x_1:", "/*0000*/ @P1 BRA `(.L_x_2) ;", "/*0000*/ FADD R1 ;", ".L_x_2:",
     "/*0000*/ @P0 BRA `(.L_x_3) ;", *["/*0000*/ FFMA R1 ;"] * 63,
     "/*0000*/ BRA `(.L_x_4) ;", ".L_x_3:", *["/*0000*/ LDG.E R1 ;"] * 66, ".L_x_4:",
     "/*0000*/ @P0 BRA `(.L_x_1) ;"]
)  # fmt: skip


def test_sides_of_branches_that_whole_warps_take_count_for_their_shares():
    code = code_of(SIDES, "sides")
    (loop,) = code.loops
    assert [(side.first, side.last) for side in code.sides(loop, 64)] == [(3, 66), (67, 132)]
    assert code.sides(loop, 65) == [side for side in code.sides(loop, 64) if side.first == 67]
    both = cost(code, Hot("1", "pair"), {})
    assert both.trip == both.most == 3 + 1 + 64 + 66
    one = cost(code, Hot("1", "pair", sides=("SHARE", "0")), {"SHARE": 1})
    assert one.trip == 3 + 1 + 64 and one.most == both.trip and one.by_kind["load global"] == 0
    assert cost(code, Hot("2", "pair", sides=("1", "1 / 4")), {}).each == (3 + 1 + 64 + 66 / 4) / 2
    # as many shares as there are sides, or both sides count
    assert cost(code, Hot("1", "pair", sides=("0",)), {}).trip == both.trip


def test_a_side_into_whose_midst_a_branch_leads_is_no_side():
    lines = SIDES.splitlines()
    midst = lines.index(".L_x_3:") + 9
    led = [*lines[:2], "/*0000*/ @P3 BRA `(.L_x_9) ;", *lines[2:midst], ".L_x_9:", *lines[midst:]]
    code = code_of("\n".join(led), "sides")
    assert [(side.first, side.last) for side in code.sides(code.loops[0], 64)] == [(4, 67)]


def test_the_work_of_the_loop_around_counts_by_its_share():
    code = code_of(LISTING, "kernel_1")
    inner = cost(code, Hot("1", "pair"), {})
    around = cost(code, Hot("1", "pair", around="GROUP"), {"GROUP": 8})
    assert (inner.trip, around.trip) == (4, 4 + 4 / 8)
    with pytest.raises(NotCounted, match="no loop is around"):
        cost(code, Hot("1", "pair", loop="barrier", trips=("1",), around="2"), {})
    assert cost(code, Hot("1", "pulse and tile", loop="kernel", trips=("1", "1", "1")), {}).trip == 13


def test_loops_that_nobody_expected_are_not_counted_but_named():
    code = code_of(LISTING, "kernel_1")
    with pytest.raises(NotCounted, match=r"trips of 0 loops inside .* 1 are there.*instructions 3 to 6.*hot_loops.py"):
        cost(code, Hot("1", "pair", loop="barrier"), {})
    with pytest.raises(NotCounted, match=r"no loop of the kind 'innermost'.*no loop at all"):
        cost(code_of(LISTING, "other"), Hot("1", "pair"), {})


def test_kinds_add_up():
    assert kinds(["FADD", "FMUL", "EXIT"]) == {"fp32": 2, "branch": 1}


def test_names_of_variants_and_kernels():
    variant = Variant("a.cl", (("TAPS", 4), ("VW", 1)))
    assert variant.name == "a.cl TAPS=4 VW=1" and Variant.named("a.cl VW=1 TAPS=4") == variant
    text = "__kernel void one(int n)\n__kernel __attribute__((reqd_work_group_size(256, 1, 1))) void two (int n)"
    assert kernels_in(text) == ["one", "two"]
