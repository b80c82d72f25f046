"""What code belongs to which part of the engine: whole files, functions and blocks, found in the sources by their first line."""

import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
CONTACT = ROOT / "contact" / "src"
KERNEL = CONTACT / "detail" / "CellKernel.inl"
LAW = CONTACT / "detail" / "CellLaw.inl"
PAIR = CONTACT / "ContactPair.cpp"
INLINE_LAW = ROOT / "contact" / "include" / "genu" / "contact" / "PressureLaw-inl.h"


def find_end(lines, first):
    """The line of the brace that closes the first one opened from line `first` on (both from 0)."""
    depth, opened = 0, False
    for i in range(first, len(lines)):
        for c in lines[i].split("//")[0]:
            depth += (c == "{") - (c == "}")
            opened = opened or c == "{"
            if opened and depth == 0:
                return i
    sys.exit(f"error: no end of {lines[first]}")


class Code:
    """Lines (from 1) of files, functions by name, and whole libraries."""

    def __init__(self):
        self.lines, self.functions, self.objects = {}, [], []

    def add(self, path, numbers):
        self.lines.setdefault(str(path), set()).update(numbers)
        return self

    def file(self, path):
        return self.add(path, range(1, len(path.read_text().splitlines()) + 1))

    def _find(self, path, start, skip):
        lines = path.read_text().splitlines()
        starts = [i for i, line in enumerate(lines) if start in line]
        if not starts:
            sys.exit(f"error: {path} has no line with {start}; scripts/counting/parts.py must follow the sources")
        for i in starts:
            end = find_end(lines, i)
            self.add(path, range(i + 1 + skip, end + 2 - skip))
        return self

    def function(self, path, *starts):
        """From its first line to its brace: what it starts with must stand in one line."""
        for start in starts:
            self._find(path, start, 0)
        return self

    def block(self, path, *starts):
        """Without the line that decides whether it runs and that of its closing brace."""
        for start in starts:
            self._find(path, start, 1)
        return self

    def named(self, *patterns):
        self.functions += [re.compile(p) for p in patterns]
        return self

    def library(self, *patterns):
        self.objects += [re.compile(p) for p in patterns]
        return self


def contact_parts():
    """Part of contact_parts: what it is, and its code."""
    detail = CONTACT / "detail"
    law = (Code().function(LAW, "void addMildPoints(", "void addLinePoints(", "void listLinePoints(", "void findLawLines(", "void readTableLanes(",
                           "void respond(", "bool isTabled(", "void sumMoments(", "void calcPointMoments(", "void calcLineMoments(",
                           "void calcLawMoments(")
           .function(detail / "CellRule.h", "LawQuadrature chooseQuadrature(").file(detail / "LawTable.h"))
    return {
        "back_of_insert": ("back surface of the insert, measured once", Code().function(CONTACT / "LayerThickness.cpp", "double operator()(const BackSurface& t)")),
        "back_of_femur": ("layer of the femur to a back surface: a map",
                          Code().function(detail / "LayerThickness.h", "double interpolate(int", "double interpolate(const", "double calcMixedSlope(",
                                          "static int findPiece(")),
        "log_strain": ("logarithmic strain", law),
        "power_law": ("power law, smooth rule (tabulated once)", law),
        "power_law_centre": ("power law solved at every element, centre rule",
                             Code().function(INLINE_LAW, "double PowerLawLayer::solve(", "LayerResponse PowerLawLayer::calcResponse(")
                             .function(CONTACT / "CentreRule.cpp", "void ContactPair::Impl::evaluateCentre(const Law&")),
        "series": ("two layers of different materials", Code().function(LAW, "void calcSharedMoments(")
                   .function(CONTACT / "PressureLaw.cpp", "SeriesResponse SeriesLayers::calcResponse(double", "InverseResponse calcInverse(")),
        "stiffness": ("stiffness of the contact",
                      Code().function(KERNEL, "void gatherLoad(", "void contract(", "void rotate(", "void sumStiffness(")
                      .block(KERNEL, "if (kWithStiffness) {", "if (withStiffness) {")
                      .block(detail / "FeetKernel.inl", "if (task.derivatives == FootDerivatives::second) {")
                      .block(detail / "FootKernel.inl", "if (derivatives == FootDerivatives::second) {")
                      .block(PAIR, "if (options.withStiffness) {").function(PAIR, "Matrix6 calcMotionOfCoordinates(")
                      .function(CONTACT / "SmoothRule.cpp", "bool detail::calcThicknessSlopeInM(", "void addStiffness(", "static bool calcThicknessSlope(")),
        "damping": ("damping", Code().block(KERNEL, "if (g.damping_sPerM > 0) {", "if (damped && f.factor > 0) {")
                    .block(PAIR, "if (damped) {").function(PAIR, "Matrix6 calcMotionChange(")),
        "energy": ("energy", Code().function(LAW, "void calcLawMoments(", "void calcPointMoments(", "void calcLineMoments(", "void respond(")),
        "energy_gradient": ("force from the gradient of the energy", Code().file(detail / "EnergyKernel.inl").file(CONTACT / "EnergyRule.cpp")),
        "fields": ("fields of every element", Code().function(PAIR, "ContactPair::calcFields(").function(CONTACT / "SmoothRule.cpp", "void ContactPair::Impl::findActive(")),
        "ray": ("distance by ray firing", Code().file(CONTACT / "RayQuery.cpp").file(detail / "RayKernel.inl")
                .function(CONTACT / "SmoothRule.cpp", "void fireRays(")),
        "search": ("breadth-first search", Code().function(CONTACT / "SmoothRule.cpp", "void search() {")),
        "grid_on_moving": ("grid on the femur", Code().file(CONTACT / "GridOnMoving.cpp")),
        "threads": ("two threads (instructions of the caller's, which vary)", Code().library(r"/libtbb\.", r"/libgenu_contact_threads\.").named(r"genu::contact::Threads::")),
    }


def element_parts():
    """The code of force elements: functions of src/musculoskeletal, src/model/Path.cpp, PathForce.h and src/model/elements."""
    return Code().named(r"genu::musculoskeletal::",
                        r"genu::model::(Path|PathForce|\(anonymous namespace\)::(Ligament|Spring|Muscle|Excitation))")
