#pragma once

#include <vector>

#include "CellKernel.h"
#include "genu/contact/PressureLaw.h"

namespace genu::contact::detail {

/** A pressure law p(e), e = d/h, as polynomials of degree 5 on pieces that grow geometrically with e (32 an octave), built
 once: the same few nanoseconds for every law, root finding or not. The slope is the polynomial's derivative and the
 energy density (int p de) its integral, so the three agree to rounding.
 Range 0 <= e <= 0.9; larger strains use the law itself (its continuation starts at 0.95).
 relativeError() is measured at construction between the fitting points; the engine uses the table only below 1e-9. */
class PressureTable {
 public:
  PressureTable(const PressureLaw& law, double strainScale);

  double relativeError() const { return relativeError_; }
  static constexpr double kLargestStrain = 0.9;
  const LawTable& view() const { return view_; }

  template <bool WithEnergy>
  void calcResponse(double e, double& p, double& dpde, double& energy) const {
    if (e < kLargestStrain) {
      readTable<WithEnergy>(view_, e, p, dpde, energy);
    } else {
      calcBeyond(e, p, dpde, energy);
    }
  }
  void calcBeyond(double e, double& p, double& dpde, double& energy) const;

 private:
  PressureLaw law_;
  double relativeError_ = 0;
  std::vector<double> pieces_;
  LawTable view_;
};

/** Where a law's singularities lie, see LawShape. */
LawShape calcLawShape(const Material& material, StrainMeasure strain);

}  // namespace genu::contact::detail
