#pragma once

// What a contact pair and its workspace hold.

#include <array>
#include <cstdint>
#include <memory>
#include <new>
#include <variant>
#include <vector>

#include "CellKernel.h"
#include "DistancePredictor.h"
#include "LayerThickness.h"
#include "PressureTable.h"
#include "TrackedHit.h"
#include "genu/contact/ContactPair.h"

namespace genu::contact {

namespace detail {

/** Numbers that the kernels read eight at a time: lines of 64 bytes, which must not straddle two of the cache. */
template <class T>
struct LineAllocator {
  using value_type = T;
  LineAllocator() = default;
  template <class U>
  explicit LineAllocator(const LineAllocator<U>&) {}
  T* allocate(size_t n) { return static_cast<T*>(::operator new(n * sizeof(T), std::align_val_t{64})); }
  void deallocate(T* p, size_t) { ::operator delete(p, std::align_val_t{64}); }
  friend bool operator==(const LineAllocator&, const LineAllocator&) { return true; }
  friend bool operator!=(const LineAllocator&, const LineAllocator&) { return false; }
};
using Numbers = std::vector<double, LineAllocator<double>>;

/** How the moving body's layer is found for one foot. */
enum class MovingLayer { none, constant, plane, map };

/** How a node's thickness was found. */
enum class ThicknessNote : unsigned char { measured, clamped, missed };

/** Grid of one compartment. Nodes are the centres of its elements, then the further ones that an element's stencil needs at its
 own spacing (cells around the rectangle, cells of another level than their neighbor): the smooth rule reads the surface there
 but integrates over elements only. */
struct Compartment {
  std::string name;
  int nx = 0, nz = 0;
  bool wraps = false;     // a full turn: elements ix = 0 and ix = nx - 1 are neighbors
  double cellSize_m = 0;  // square root of dx dz, or of the mean element area on a round element surface
  const ContactSurface *fixed = nullptr, *moving = nullptr;
  const ThicknessMap* map = nullptr;
  std::unique_ptr<DistancePredictor> predictor;  // smooth rule
  int elements = 0;
  std::vector<GridCell> cell;  // of each node
  std::vector<int> element;    // of each cell of level 0, -1 where there is none
  std::vector<std::array<int, 9>> stencil;  // nodes around each element, order of CellRule.h; -1: none
  // Of each node:
  std::vector<Vec3> p_FA, normal_F;
  std::vector<double> area_m2, hF_m;
  Numbers place;  // the four above together, see CellKernel.h
  std::vector<unsigned char> neighbors;  // of each element, as a mask (CellRule.h)
  std::vector<std::uint16_t> freshNodes;  // of each element, as a mask: places in its stencil that the element before has not
  double stencilReach_m = 0;  // largest distance of a stencil's node from its element
  std::vector<double> cellReach_m;  // of each element: how far the polynomial through its nodes' places goes from its centre
  std::vector<ThicknessNote> note;
  std::array<Vec3, 8> corner_F;  // box around all nodes
  size_t size() const { return static_cast<size_t>(elements); }
  size_t numNodes() const { return p_FA.size(); }
};

/** The cells of a grid, in the order of its elements (which are those that meet the surface). Checks `refined`. */
std::vector<GridCell> findLeaves(const CompartmentDefinition& c);

/** An element in contact during one evaluation. */
struct Active {
  int element = -1;
  double d_m = 0, h_m = 0, hM_m = 0, p_Pa = 0;
  double share = 1;       // of its area that is in contact
  double force_N = 0;     // int p dA
  Vec3 direction_F = Vec3::Zero();
};

struct CompartmentMemory {
  // Centre rule, of the last query of each element:
  std::vector<SurfaceParameter> foot;  // patch -1: never queried
  std::vector<TrackedHit> hits;        // ray method only
  std::vector<Vec3> p_MA;              // where it was
  std::vector<double> clearance_m;     // contact is impossible within this distance of p_MA
  std::vector<double> distance_m;      // signed
  std::vector<char> onBorder;          // foot on the moving surface's border
  std::vector<Active> active;          // in element order
  // Both rules:
  std::vector<unsigned> visit;         // evaluation that tested it last (search modes)
  std::vector<int> queue;
  std::vector<int> previous;           // elements active in the evaluation before
  // Smooth rule, of each node:
  std::vector<TrackedFoot> feet;
  std::vector<unsigned> nodeVisit;     // evaluation that queried it last
  std::vector<char> usable;
  std::vector<NodeField> field;
  Numbers s, r, load, weight, adjoint, share, byShare; // see CellGrid
  Numbers gradient, layer;             // energy form only, see EnergyKernel.h
  std::vector<int> energyNodes;
  std::vector<unsigned long> touched;
  std::vector<int> nodes;              // queried in this evaluation: the first numNodes
  size_t numNodes = 0;
  Numbers query;
  TrackedFoot peakFoot;                // on the fixed surface, of the last place between nodes where the peak was sought
  PeakPlace peak;                      // where it was met: cell and place in it; cell -1: nowhere
  // Smooth rule, of elements:
  std::vector<int> due, candidates, candidateMask;
  Numbers candidateBound;
  std::vector<CellTask> tasks;         // cells that may be in contact, in element order
  Numbers cells;                       // their results, see CellKernel.h
  int cellStride = 0;
  // Way of the fastest point of the grid's box, summed over the evaluations, and what each element's mark
  // promises until then (SmoothRule.cpp).
  double way_m = 0;
  double turn = 0;  // rotation, summed the same way
  std::vector<double> mark_m;
  std::vector<ElementLook> look;
  Pose last_FM;
  bool hasLast = false;
};

/** One evaluation. */
struct EvaluationTask {
  Pose X_FM;
  Vec3 v_F = Vec3::Zero(), w_F = Vec3::Zero();  // motion of M at Fo, read with damping only
  bool withEnergy = false, withStiffness = false;
  unsigned stamp = 0;
  const TaskRunner* runner = nullptr;
  // out
  NetLoad* loads = nullptr;  // per compartment
  int* queries = nullptr;    // added to
  Matrix6 byMotion = Matrix6::Zero(), byRate = Matrix6::Zero();  // d(force, moment)/d(v, w) and its rate
};

/** What the element loops read. */
struct PairData {
  ContactPairDefinition definition;  // bodies exchanged where the grid is on the moving body (GridOnMoving.h)
  std::variant<LinearLayer, PowerLawLayer, SeriesLayers> law;
  std::unique_ptr<PressureTable> table;  // smooth rule and a nonlinear law of one material
  LawShape shape{};
  MovingLayer movingLayer = MovingLayer::none;
  double constantMoving_m = 0, planeMovingY_m = 0;
};

/** Slope of the moving layer's thickness with respect to the query point of a foot, in M; false where it is clamped. Map and plane
 layers only. */
bool calcThicknessSlopeInM(const PairData& impl, const Compartment& c, const TrackedFoot& foot, double slope[3]);

}  // namespace detail

struct ContactPair::Impl : detail::PairData {
  ContactPairDefinition given;  // as the user gave it
  std::vector<detail::Compartment> compartments;
  std::vector<GridReport> gridReports;
  std::vector<ThicknessMapReport> mapReports;
  std::vector<std::shared_ptr<const detail::ThicknessMap>> maps;

  explicit Impl(ContactPairDefinition d);

  /** What the kernels read, from the arrays of a finished grid. */
  static void packCompartment(detail::Compartment& c);
  void sizeSmoothMemory(const detail::Compartment& c, detail::CompartmentMemory& memory) const;
  /** Adds the grid of one compartment; nodes that `known`, a grid of the same surfaces and spacing, has are taken from it. */
  void buildCompartment(const CompartmentDefinition& c, const detail::Compartment* known = nullptr);

  /** Whole elements, in contact or not by their centre [BF2004 §2.3]. */
  template <class Law>
  void evaluateCentre(const Law& law, const detail::Compartment& c, const detail::EvaluationTask& task, detail::CompartmentMemory& memory,
                      NetLoad& load, int& queries) const;
  /** The smooth rule on all compartments. */
  void evaluateSmooth(std::vector<detail::CompartmentMemory>& memory, detail::EvaluationTask& task) const;
  /** What the pressure rises around the place of a compartment's peak, by further queries at pose X_FM of the last evaluation; `load`:
   that evaluation's. Smooth rule. */
  double calcPeakRise(const detail::Compartment& c, detail::CompartmentMemory& memory, const Pose& X_FM, const NetLoad& load) const;
  /** Marks the elements in contact that the grid does not resolve (ElementField::unresolved). Smooth rule. */
  void markUnresolved(const detail::Compartment& c, const detail::CompartmentMemory& memory, const NetLoad& load, std::vector<ElementField>& fields) const;
  /** Elements in contact in the last evaluation, in their order. */
  void findActive(const detail::Compartment& c, const detail::CompartmentMemory& memory, std::vector<detail::Active>& active) const;
};

struct ContactWorkspace::Impl {
  std::vector<detail::CompartmentMemory> compartments;
  JointCoordinates storedQ{}, storedRates{};
  ContactResult stored;
  bool hasStored = false, storedWithEnergy = false, storedWithStiffness = false;
  const TaskRunner* runner = nullptr;
  Pose X_FM;         // of the last evaluation
  Pose X_evaluated;  // X_FM, or its inverse where the grid is on the moving body
  unsigned stamp = 0;
};

}  // namespace genu::contact
