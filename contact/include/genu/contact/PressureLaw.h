#pragma once

#include <string>
#include <variant>

namespace genu::contact {

/** Pressure laws of the elastic foundation [BF2004 §2.3].

 Symbols: d penetration along the midsurface normal [m], h layer thickness [m], E Young's modulus [Pa],
 nu Poisson's ratio, c = (1-nu)/((1+nu)(1-2nu)), K = c E confined modulus [Pa].
 Bonded thin layer on rigid backing, no friction, never tensile.

   strain measure   small: x = d/h                 (eq. 1)
                    large: x = -ln(1 - d/h)        (eq. 2)
   material         linear:               p = K x
                    power-law:            (eps0/2) (s + n s^n) = c x,  s = p/p0   (eq. 4 as a secant, as printed;
                                          agrees with Table 4)
                    power-law-consistent: (eps0/2) (s + s^n)   = c x              (eq. 3 itself, integrated)

 d <= 0 gives exactly 0. Beyond d/h = 0.95 the large-strain measure continues along its tangent (C1) and every law
 flags `extrapolated`. Slope is dp/dd at constant h. Energy is the integral of p over d from 0, per area [J/m^2]; with
 large strain and a power law it is a Gauss-Legendre quadrature (relative error < 1e-10 up to d/h = 0.95).
 n > 1 needs one scalar monotone Newton solve (n = 3: closed form); linear laws need none. */

enum class StrainMeasure { small, large };
enum class MaterialLaw { linear, powerLaw, powerLawConsistent };

/** What a user gives. @pre 0 <= nu < 0.5; linear: E > 0; power laws: eps0 > 0, p0 > 0, n >= 1. */
struct Material {
  MaterialLaw law = MaterialLaw::linear;
  double E_Pa = 0;
  double nu = 0;
  double eps0 = 0, p0_Pa = 0, n = 1;

  double confinementFactor() const { return (1 - nu) / ((1 + nu) * (1 - 2 * nu)); }  ///< c
  /** @throws std::invalid_argument naming the value and the allowed range */
  void validate() const;
  bool operator==(const Material& other) const;
};

/** Ratio d/h where the continuation starts. */
inline constexpr double kExtrapolationStrain = 0.95;

struct LayerResponse {
  double p_Pa = 0;
  double dpdd_PaPerM = 0;
  double energy_JPerM2 = 0;  ///< 0 when not asked for
  bool extrapolated = false;
};

/** One layer, or two layers of the same material counted as one of the summed thickness [BF2004 §2.3]. */
class LinearLayer {
 public:
  LinearLayer(const Material& material, StrainMeasure strain);
  template <bool WithEnergy = true>
  LayerResponse calcResponse(double d_m, double h_m) const;
  double K_Pa() const { return K_; }

 private:
  double K_;
  bool large_;
};

class PowerLawLayer {
 public:
  PowerLawLayer(const Material& material, StrainMeasure strain);
  template <bool WithEnergy = true>
  LayerResponse calcResponse(double d_m, double h_m) const;

  /** Root s >= 0 of s + m s^n = y; monotone Newton, at most 60 steps. */
  double solve(double y) const;

 private:
  /** Integral of p de from 0 to e [Pa]; x and s belong to e. */
  double calcEnergyPerLayer(double e, double x, double s) const;

  double c_, eps0_, p0_, n_;
  double m_;  // n as printed, 1 consistent
  bool large_;
};

using PressureLaw = std::variant<LinearLayer, PowerLawLayer>;

/** @throws std::invalid_argument, see Material::validate */
PressureLaw makePressureLaw(const Material& material, StrainMeasure strain);

/** Of two layers in series; pressure depends on both thicknesses. */
struct SeriesResponse : LayerResponse {
  double dpdhF_PaPerM = 0, dpdhM_PaPerM = 0;  ///< slopes at constant penetration, <= 0
};

/** Two layers of different materials in series: the pressure is common, d = d_F(p) + d_M(p). Each law is inverted
 in closed form (strain from pressure); one monotone safeguarded Newton solve in p per element. The result has the
 slope and energy of the pair. One of the thicknesses may be 0: then the other layer acts alone.
 With e_F(p), e_M(p) the strains and S = hF e_F' + hM e_M':  dp/dd = 1/S,  dp/dhF = -e_F/S,  dp/dhM = -e_M/S. */
class SeriesLayers {
 public:
  SeriesLayers(const Material& fixedMaterial, const Material& movingMaterial, StrainMeasure strain);
  template <bool WithEnergy = true>
  SeriesResponse calcResponse(double d_m, double hF_m, double hM_m) const;

 private:
  Material materialF_, materialM_;
  PressureLaw lawF_, lawM_;
  StrainMeasure strain_;
};

}  // namespace genu::contact

#include "genu/contact/PressureLaw-inl.h"
