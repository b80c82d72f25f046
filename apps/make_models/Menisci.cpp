#include <cmath>
#include <sstream>

#include "KneeAnatomy.h"

namespace genu::make_models {

namespace {

/** A meniscus as a band under tension (hoop): from its anterior root on the tibia, outside round the condyle, to its
 posterior root. Bei & Fregly 2004 propose springs as the first step. */
struct Meniscus {
  const char* name;
  Side side;
  double condyleZ, sagittalRadius, coronalRadius;  ///< NaturalKnee.cpp
  double thickness;                                ///< mean of posterior and anterior, with cartilage
  double rootZ[2], rootX[2];                       ///< anterior, posterior
  double excursion;                                ///< how far the femur moves back before the band is tight
};

// Thickness with cartilage, posterior and anterior: 7.6, 5.2 medial; 8.6, 5.2 lateral (doi 10.1002/ca.22118, abstract).
//
// Roots, 30 knees (discovery.researcher.life/topic/posterior-root-of-lateral-meniscus/1081239, abstract): medial ones 25.40
// anterior and 11.73 posterior of the apex of the medial eminence, the posterior one 3.92 lateral of the border of the
// plateau's cartilage, the anterior one 3.01 - 2.77 farther; lateral ones 12.97 anterior and 4.51 posterior of the
// apex of the lateral eminence, the posterior one 3.16 medial of the border, the anterior one 1.31 + 1.85 less. Where
// the apexes are in this knee was not found: the medial roots are centered on their plateau, and both apexes are put at
// the x that follows. They lie at the height of the plateau's border.
//
// Excursion of the menisci over flexion: 5.1 and 11.2 (Thompson et al. 1991, Am J Sports Med 19:210; recalled,
// unverified).
constexpr double kMedialSpread = 0.5 * (25.40 + 11.73), kApexX = 25.40 - kMedialSpread;
constexpr double kMedialBorder = 6.5, kLateralBorder = -6.0;
const Meniscus kMenisci[] = {{"medial_meniscus", Side::medial, 20.5, 20.4, 16.5, 0.5 * (7.6 + 5.2),
                              {kMedialBorder - 3.92 - (3.01 - 2.77), kMedialBorder - 3.92}, {-kMedialSpread, kMedialSpread}, 5.1},
                             {"lateral_meniscus", Side::lateral, -24.0, 20.8, 17.0, 0.5 * (8.6 + 5.2),
                              {kLateralBorder + 3.16 - (1.31 + 1.85), kLateralBorder + 3.16}, {kApexX - 12.97, kApexX + 4.51}, 11.2}};

// Modulus along the circumference 140 MPa, each root 2000 N/mm: values of many finite element models of the knee (quoted
// in citations of Yao et al. 2006, "Sensitivity of the tibio-femoral response to finite element modeling parameters",
// scite.ai; experiments behind both: Haut Donahue et al. 2003, J Biomech 36:19). Section: a triangle, 9 wide (recalled,
// unverified). Length: about 75, as the band is here.
constexpr double kModulus_MPa = 140, kWidth = 9, kLength = 75, kRoot_NPerMm = 2000;

double calcStiffness_NPerMm(const Meniscus& meniscus) {
  const double hoop = kModulus_MPa * 0.5 * kWidth * meniscus.thickness / kLength;
  return 1 / (1 / hoop + 2 / kRoot_NPerMm);
}

Vec3 placeRoot(const Meniscus& meniscus, int end) {
  const double border = meniscus.side == Side::medial ? kMedialBorder : kLateralBorder;
  return {meniscus.rootX[end], plateauHeight(meniscus.side, meniscus.rootX[end], border), meniscus.rootZ[end]};
}

/** A point of the band at half of the meniscus' thickness, on the circumference of the condyle there; `angle` from the
 outward direction towards posterior. It turns back against flexion, so that it stays above the plateau: a row per 15
 degrees. */
std::string writeBandPoint(const Meniscus& meniscus, double angle) {
  const double height = 0.5 * meniscus.thickness;
  const auto halfChord = [height](double radius) { return std::sqrt(radius * radius - (radius - height) * (radius - height)); };
  const double dx = halfChord(meniscus.sagittalRadius) * std::sin(angle);
  const double dz = (meniscus.side == Side::medial ? 1 : -1) * halfChord(meniscus.coronalRadius) * std::cos(angle);
  std::ostringstream out;
  out << "{body: femur, moving: {coordinate: tibiofemoral.rz, at: [";
  for (int flexion = 135; flexion >= -15; flexion -= 15) {
    const double phi = flexion * kDegree, c = std::cos(phi), s = std::sin(phi);
    const Vec2 bottom = lowestCondylePoint(meniscus.side, phi);
    out << "[" << -flexion << " deg, " << writeNumber(bottom.x() + c * dx - s * height, 3) << " mm, "
        << writeNumber(bottom.y() + s * dx + c * height, 3) << " mm, " << writeNumber(meniscus.condyleZ + dz, 3) << " mm]"
        << (flexion > -15 ? ", " : "");
  }
  out << "]}}";
  return out.str();
}

}  // namespace

std::string writeMenisci(const Vec3& extensionRotation_deg, const Vec3& extension_mm, const std::string& otherJoints) {
  std::ostringstream out;
  out << "poses:\n"
      << "  # Extension, the femur moved back by the excursion of the meniscus: there its band begins to pull.\n";
  for (const Meniscus& meniscus : kMenisci) {
    out << "  " << meniscus.name << ": {tibiofemoral: \"" << writeNumber(extensionRotation_deg.x(), 1) << " deg, "
        << writeNumber(extensionRotation_deg.y(), 1) << " deg, " << writeNumber(extensionRotation_deg.z(), 1) << " deg, "
        << writeNumber(extension_mm.x() + meniscus.excursion, 1) << " mm, " << writeNumber(extension_mm.y(), 1) << " mm, "
        << writeNumber(extension_mm.z(), 1) << " mm\", " << otherJoints << "}\n";
  }
  out << "\nsprings:\n"
      << "  # From root to root round the condyle; the hoop's stiffness in series with both roots'.\n";
  for (const Meniscus& meniscus : kMenisci) {
    out << "  " << meniscus.name << ":\n    stiffness: " << writeNumber(calcStiffness_NPerMm(meniscus), 1)
        << " N/mm\n    rest: {force: 0 N, pose: " << meniscus.name << "}\n    path:\n"
        << "      - {body: tibia, at: " << writePoint(placeRoot(meniscus, 0)) << "}\n";
    for (const double angle : {-45.0, 0.0, 45.0}) out << "      - " << writeBandPoint(meniscus, angle * kDegree) << '\n';
    out << "      - {body: tibia, at: " << writePoint(placeRoot(meniscus, 1)) << "}\n";
  }
  return out.str();
}

}  // namespace genu::make_models
