#include "genu/fit/Frame.h"

#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

Pose calcAxesPose(FileAxes axes) {
  Pose X;
  if (axes == FileAxes::lateral) X.R = Vec3(-1, 1, -1).asDiagonal();
  return X;
}

Pose calcBoundingBoxFrame(const TriangleMesh& mesh, FileAxes axes, std::optional<double> referenceY_m) {
  const Eigen::AlignedBox3d box = mesh.calcBoundingBox();
  Vec3 origin = box.center();
  origin.y() = referenceY_m.value_or(box.min().y());
  Pose X = calcAxesPose(axes);
  X.p = -(X.R * origin);
  return X;
}

Pose calcLandmarkFrame(const Landmarks& landmarks, KneeSide side) {
  if (!landmarks.medial || !landmarks.lateral) {
    throw InputError(std::string("landmark frame: landmark ") + (landmarks.medial ? "lateral" : "medial") +
                     " is missing; needed: medial, lateral, and anterior with posterior or superior with inferior");
  }
  const bool sagittal = landmarks.anterior && landmarks.posterior;
  const bool vertical = landmarks.superior && landmarks.inferior;
  if (sagittal == vertical) {
    throw InputError(std::string("landmark frame: ") +
                     (sagittal ? "anterior with posterior and superior with inferior are both given"
                               : "the second direction is missing") +
                     "; needed: exactly one of the pairs anterior with posterior, superior with inferior");
  }
  Vec3 z = *landmarks.medial - *landmarks.lateral;
  if (!(z.norm() > 1e-6)) throw InputError("landmark frame: landmarks medial and lateral coincide");
  z.normalize();
  Vec3 x;
  if (sagittal) {
    x = side == KneeSide::right ? Vec3(*landmarks.posterior - *landmarks.anterior)
                                : Vec3(*landmarks.anterior - *landmarks.posterior);
  } else {
    x = (*landmarks.superior - *landmarks.inferior).cross(z);
  }
  const double length = x.norm();
  x -= x.dot(z) * z;
  if (!(length > 1e-6) || x.norm() < 1e-3 * length) {
    throw InputError(std::string("landmark frame: the points ") +
                     (sagittal ? "anterior and posterior" : "superior and inferior") +
                     " coincide, or lie along the line from lateral to medial");
  }
  x.normalize();
  const Vec3 y = z.cross(x);
  const Vec3 origin = landmarks.center.value_or(0.5 * (*landmarks.medial + *landmarks.lateral));
  Pose X;
  X.R.row(0) = x;
  X.R.row(1) = y;
  X.R.row(2) = z;
  X.p = -(X.R * origin);
  return X;
}

std::string formatPose(const Pose& pose) {
  const contact::JointCoordinates q = contact::calcCoordinates(pose);
  std::string text;
  for (size_t i = 0; i < 6; ++i) {
    if (i > 0) text += ", ";
    text += io::formatNumber(q[i] + 0.0) + (i < 3 ? " rad" : " m");
  }
  return text;
}

}  // namespace genu::fit
