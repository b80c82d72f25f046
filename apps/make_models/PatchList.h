#pragma once

#include <iomanip>
#include <ostream>
#include <string>
#include <vector>

#include "SplineFit.h"
#include "genu/io/NurbsFile.h"

namespace genu::make_models {

/** Patches of one file, and what is printed about them. */
class PatchList {
 public:
  PatchList(std::string file, std::ostream& report) : file_(std::move(file)), report_(report) {}

  void add(const std::string& name, const std::vector<double>& knotsU, const std::vector<double>& knotsV,
           const SurfaceFunction& surface) {
    patches_.push_back({name, fitPatch(knotsU, knotsV, surface)});
    const contact::NurbsPatchData& patch = patches_.back().data;
    const FitError error = calcFitError(patch, surface);
    report_ << std::left << std::setw(22) << file_ << std::setw(10) << name << std::right << std::setw(3) << patch.numU
            << " x " << std::setw(2) << patch.numV << "  max " << std::scientific << std::setprecision(1)
            << error.max_mm << " mm, rms " << error.rms_mm << " mm\n"
            << std::defaultfloat;
  }
  void write(const std::filesystem::path& folder, const std::string& comment) const {
    io::writeNurbsFile(folder / file_, patches_, comment);
  }

 private:
  std::string file_;
  std::ostream& report_;
  std::vector<io::NamedPatch> patches_;
};

}  // namespace genu::make_models
