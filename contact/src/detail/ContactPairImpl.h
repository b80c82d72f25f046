#pragma once

// What a contact pair and its workspace hold.

#include <array>
#include <memory>
#include <variant>
#include <vector>

#include "LayerThickness.h"
#include "PressureTable.h"
#include "TrackedFoot.h"
#include "genu/contact/ContactPair.h"

namespace genu::contact {

namespace detail {

/** How the moving body's layer is found for one foot. */
enum class MovingLayer { none, constant, plane, map };

/** Grid of one compartment. Nodes are the centres of its elements, then those of the cells around the rectangle and of cells
 without a layer: the smooth rule reads the surface there but integrates over elements only. */
struct Compartment {
  std::string name;
  int nx = 0, nz = 0;
  bool wraps = false;     // a full turn: elements ix = 0 and ix = nx - 1 are neighbors
  double cellSize_m = 0;  // square root of dx dz, or of the mean element area on a round element surface
  const ContactSurface* moving = nullptr;
  const ThicknessMap* map = nullptr;
  int elements = 0;
  std::vector<int> cell;     // ix * nz + iz of each element
  std::vector<int> element;  // of each cell, -1 where there is none
  std::vector<std::array<int, 9>> stencil;  // nodes around each element, order of CellRule.h; -1: none
  // Of each node:
  std::vector<Vec3> p_FA, normal_F;
  std::vector<double> area_m2, hF_m;
  std::array<Vec3, 8> corner_F;  // box around all nodes
  size_t size() const { return static_cast<size_t>(elements); }
  size_t numNodes() const { return p_FA.size(); }
};

/** An element in contact during one evaluation. */
struct Active {
  int element = -1;
  double d_m = 0, h_m = 0, hM_m = 0, p_Pa = 0;
  double share = 1;       // of its area that is in contact
  double force_N = 0;     // int p dA
  Vec3 direction_F = Vec3::Zero();
};

/** What the smooth rule knows of a node at the current pose. */
struct NodeField {
  double s_m;   // penetration before the midsurface correction, > 0 in contact
  double r;     // c / h [1/m]: strain = s r
  double c;     // d = c s
  double h_m, hM_m;
  Vec3 m_F;     // force direction on M
  Vec3 u_F;     // direction of the distance, turned into M
  double length;  // |n + u| where the correction is on, 0 where it is off
  bool usable;
};

struct CompartmentMemory {
  // Centre rule, of the last query of each element:
  std::vector<SurfaceParameter> foot;  // patch -1: never queried
  std::vector<Vec3> p_MA;              // where it was
  std::vector<double> clearance_m;     // contact is impossible within this distance of p_MA
  std::vector<double> distance_m;      // signed
  std::vector<char> onBorder;          // foot on the moving surface's border
  // Both rules:
  std::vector<unsigned> visit;         // evaluation that tested it last (search modes)
  std::vector<int> queue;
  std::vector<Active> active;          // in element order
  std::vector<int> previous;           // elements active in the evaluation before
  // Smooth rule, of each node:
  std::vector<TrackedFoot> feet;
  std::vector<unsigned> nodeVisit;     // evaluation that queried it last
  std::vector<NodeField> field;
  std::vector<double> weight, weightArea, weightEnergy;
  std::vector<std::array<double, 6>> adjointS, adjointR;  // stiffness only
  std::vector<int> nodes;              // queried in this evaluation
  std::vector<double> query;
  // Of each element: it cannot touch while no node has moved by more than this since the reference pose.
  std::vector<double> threshold_m;
  std::vector<int> candidates;
  Pose reference_FM;
  bool hasReference = false;
};

/** What the element loops read. */
struct PairData {
  ContactPairDefinition definition;  // bodies exchanged where the grid is on the moving body (GridOnMoving.h)
  std::variant<LinearLayer, PowerLawLayer, SeriesLayers> law;
  std::unique_ptr<PressureTable> table;  // smooth rule and a nonlinear law of one material
  MovingLayer movingLayer = MovingLayer::none;
  double constantMoving_m = 0, planeMovingY_m = 0;
};

}  // namespace detail

struct ContactPair::Impl : detail::PairData {
  ContactPairDefinition given;  // as the user gave it
  std::vector<detail::Compartment> compartments;
  std::vector<GridReport> gridReports;
  std::vector<ThicknessMapReport> mapReports;
  std::vector<std::unique_ptr<detail::ThicknessMap>> maps;

  explicit Impl(ContactPairDefinition d);

  void buildCompartment(const CompartmentDefinition& c);

  /** Whole elements, in contact or not by their centre [BF2004 §2.3]. */
  template <class Law>
  void evaluateCentre(const Law& law, const detail::Compartment& c, const Pose& X_FM, bool withEnergy,
                      detail::CompartmentMemory& memory, unsigned stamp, NetLoad& load, int& queries) const;
  /** The smooth rule; adds d(force, moment)/d(translation, rotation about Fo) to `stiffness` when it is given. */
  void evaluateSmooth(const detail::Compartment& c, const Pose& X_FM, bool withEnergy, detail::CompartmentMemory& memory,
                      unsigned stamp, NetLoad& load, int& queries, Matrix6* stiffness) const;
};

struct ContactWorkspace::Impl {
  std::vector<detail::CompartmentMemory> compartments;
  JointCoordinates storedQ{};
  ContactResult stored;
  bool hasStored = false, storedWithEnergy = false, storedWithStiffness = false;
  Pose X_FM;      // of the last evaluation
  Pose X_evaluated;  // X_FM, or its inverse where the grid is on the moving body
  unsigned stamp = 0;
};

}  // namespace genu::contact
