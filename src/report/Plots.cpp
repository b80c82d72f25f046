#include "Plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "genu/io/Files.h"
#include "genu/report/ContactReport.h"

namespace genu::report {
using contact::NetLoad;
using contact::Vec3;
using scene::Frame;

namespace {

// Okabe & Ito, "Color universal design" (2008): told apart with any colour vision.
constexpr std::array<const char*, 6> kColors = {"#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"};

constexpr const char* kCommon =
    "set encoding utf8\n"
    "set border lw 1.2 lc rgb '#404040'\n"
    "set tics textcolor rgb '#202020'\n"
    "set grid lw 1 lt 1 lc rgb '#dddddd'\n";

/** A single-quoted gnuplot string; control characters cannot end it. */
std::string quote(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'')
      out += "''";
    else
      out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
  }
  return out + "'";
}

constexpr std::array<const char*, 6> kCoordinateTitles = {"varus-valgus rx",      "internal-external ry",
                                                          "flexion-extension rz", "anterior-posterior x",
                                                          "superior-inferior y",  "medial-lateral z"};

struct Curve {
  std::string title;
  int column;  ///< in the data file, from 1
  const char* color;
  int dash = 1;
};

struct Panel {
  std::string label;  ///< of the vertical axis
  std::vector<Curve> curves;
  bool fromZero = false;
};

/** Panels above each other over a common time axis. */
std::string makeTimeScript(const std::string& name, const std::vector<Panel>& panels, double tEnd_s,
                           const std::string& referenceFile = {}, const std::vector<int>& referenceColumns = {}) {
  const int count = static_cast<int>(panels.size());
  const int height = 130 + 300 * count;
  // The panels are 764 pixels wide; the key beside them has room for its longest title.
  size_t longest = 0;
  for (const Panel& panel : panels) {
    for (const Curve& curve : panel.curves) longest = std::max(longest, curve.title.size());
  }
  const int width = std::max(1100, 970 + static_cast<int>(9.5 * static_cast<double>(longest)));
  std::string script = fmt::format(
      "# Draw again with: gnuplot {0}.gp\n"
      "set terminal pngcairo size {4},{1} font 'DejaVu Sans,14' background rgb 'white' noenhanced\n"
      "set output '{0}.png'\n{2}"
      "set datafile missing 'nan'\n"
      "set xrange [0:{3}]\n"
      "set multiplot\n",
      name, height, kCommon, tEnd_s, width);
  const double bottom = 75.0 / height, top = 1 - 25.0 / height, gap = 24.0 / height;
  const double panelHeight = (top - bottom - gap * (count - 1)) / count;
  for (int i = 0; i < count; ++i) {
    const Panel& panel = panels[static_cast<size_t>(i)];
    const double high = top - i * (panelHeight + gap);
    script += fmt::format(
        "\nset lmargin at screen {:.5f}\nset rmargin at screen {:.5f}\nset tmargin at screen {:.5f}\nset bmargin at "
        "screen "
        "{:.5f}\nset ylabel {} offset 0.5\nset key at screen {:.5f}, screen {:.5f} left center vertical maxcols 1 Left reverse "
        "samplen "
        "2.5 spacing 1.3\n",
        115.5 / width, 880.0 / width, high, high - panelHeight, quote(panel.label), 896.5 / width, high - panelHeight / 2);
    script += i + 1 < count ? "set format x ''\nunset xlabel\n" : "set format x '%g'\nset xlabel 'time (s)'\n";
    script += panel.fromZero ? "set yrange [0:*]\nset offsets 0, 0, graph 0.05, 0\n"
                             : "set yrange [*:*]\nset offsets 0, 0, graph 0.05, graph 0.05\n";
    script += "plot ";
    for (size_t c = 0; c < panel.curves.size(); ++c) {
      const Curve& curve = panel.curves[c];
      script +=
          fmt::format("{}'{}.dat' using 1:{} with lines lw 2.5 dt {} lc rgb '{}' title {}", c == 0 ? "" : ", \\\n     ",
                      name, curve.column, curve.dash, curve.color, quote(curve.title));
    }
    const int reference = referenceColumns.empty() ? 0 : referenceColumns[static_cast<size_t>(i)];
    if (reference > 0) {
      script += fmt::format(", \\\n     '{}' using 1:{} with lines lw 2.5 dt 2 lc rgb '#333333' title 'reference'",
                            referenceFile, reference);
    }
    script += "\n";
  }
  return script + "\nunset multiplot\n";
}

void writePlot(OutputFolder& out, const std::string& name, const std::string& data, const std::string& script) {
  io::writeFileAtomically(out.file("plots/" + name + ".dat"), data);
  io::writeFileAtomically(out.file("plots/" + name + ".gp"), script);
}

struct Bar {
  std::string name;
  double value;
  std::string note;  ///< behind the bar
};

/** Horizontal bars, the first on top. */
void writeBars(OutputFolder& out, const std::string& name, const std::string& label, const std::vector<Bar>& bars) {
  std::string data = "# name value note\n";
  for (const Bar& bar : bars) data += fmt::format("\"{}\" {:.9g} \"{}\"\n", bar.name, bar.value, bar.note);
  size_t longest = 0;
  double low = 0, high = 0;
  for (const Bar& bar : bars) {
    longest = std::max(longest, bar.name.size());
    low = std::min(low, bar.value);
    high = std::max(high, bar.value);
  }
  if (high == low) high = 1;
  const int left = 48 + static_cast<int>(9.5 * static_cast<double>(longest)), width = left + 760,
            height = 110 + 24 * static_cast<int>(bars.size());
  const std::string script = fmt::format(
      "# Draw again with: gnuplot {0}.gp\n"
      "set terminal pngcairo size {1},{2} font 'DejaVu Sans,14' background rgb 'white' noenhanced\n"
      "set output '{0}.png'\n{3}"
      "set lmargin at screen {4:.5f}\nset rmargin at screen {5:.5f}\nset tmargin at screen {6:.5f}\nset bmargin at screen {7:.5f}\n"
      "unset key\nset xlabel {8}\nset yrange [{9}:-0.6]\nset xrange [{11:.6g}:{12:.6g}]\n"
      "set ytics scale 0\nset grid noytics\nset style fill solid 1.0 noborder\n"
      "plot '{0}.dat' using 2:0:(0):2:($0-0.35):($0+0.35):ytic(1) with boxxyerror lc rgb '{10}', \\\n"
      "     '' using ($2 > 0 ? $2 : 0):0:3 with labels left offset 0.6,0 font ',12' tc rgb '#202020'\n",
      name, width, height, kCommon, static_cast<double>(left) / width, 1 - 40.0 / width, 1 - 20.0 / height, 80.0 / height, quote(label),
      static_cast<double>(bars.size()) - 0.4, kColors[0], low - 0.05 * std::max(-low, 0.0), high + 0.45 * (high - low));
  writePlot(out, name, data, script);
}

/** One line per frame: time and `values(load)` of every compartment, then of their sum. */
template <class Values>
std::string makeLoadData(const scene::Scene& scene, const std::vector<Frame>& frames, const std::string& header,
                         Values values) {
  std::string data = "# " + header + "\n";
  for (const auto& frame : frames) {
    data += fmt::format("{}", frame.time_s);
    for (const auto& row : listLoads(scene, frame.contacts)) {
      for (const double value : values(row.load)) data += fmt::format(" {:.9g}", value);
    }
    for (const double value : values(sumLoads(frame.contacts))) data += fmt::format(" {:.9g}", value);
    data += "\n";
  }
  return data;
}

double calcTimeRange(const std::vector<Frame>& frames) { return std::max(frames.back().time_s, 1e-9); }

}  // namespace

std::vector<std::string> writeMotionPlots(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory,
                                          const RunInfo& info) {
  const std::vector<scene::CoordinateInfo> coordinates = scene.coordinates();
  const bool several = scene.model && !scene.model->joints.empty();
  std::vector<std::string> scripts;
  for (size_t first = 0, next = 0; first < coordinates.size(); first = next) {
    std::vector<size_t> shown;
    while (next < coordinates.size() && coordinates[next].joint == coordinates[first].joint) {
      if (!scene.model || coordinates[next].isFree) shown.push_back(next);
      ++next;
    }
    if (shown.empty()) continue;
    const std::string name = several ? "motion_" + coordinates[first].joint : "motion";
    std::string data = "# time_s";
    for (const size_t i : shown) data += fmt::format(" {}_{}", coordinates[i].name, coordinates[i].unit());
    data += "\n";
    for (const auto& frame : trajectory.frames) {
      data += fmt::format("{}", frame.time_s);
      for (const size_t i : shown) data += fmt::format(" {:.9g}", frame.q[i] * coordinates[i].unitsPerSi());
      data += "\n";
    }
    std::vector<Panel> panels;
    std::vector<int> referenceColumns;
    int column = 2;
    int numReference = 0;
    for (const size_t i : shown) {
      const scene::CoordinateInfo& c = coordinates[i];
      const bool floating = c.shortName != "angle" && c.shortName != "translation";
      const std::string title = !floating ? c.name : several ? c.name : kCoordinateTitles[static_cast<size_t>(c.axis)];
      panels.push_back({fmt::format("{} ({})", title, c.unit()), {{"predicted", column++, kColors[0]}}});
      const bool known = info.reference && info.reference->coordinate.count(static_cast<int>(i)) > 0;
      referenceColumns.push_back(known ? ++numReference + 1 : 0);
    }
    const std::string referenceFile = name + "_reference.dat";
    if (numReference > 0) {
      std::string text = "# reference: " + info.reference->source + "\n";
      for (size_t row = 0; row < info.reference->time_s.size(); ++row) {
        text += fmt::format("{}", info.reference->time_s[row]);
        for (const size_t i : shown) {
          const auto found = info.reference->coordinate.find(static_cast<int>(i));
          if (found != info.reference->coordinate.end()) text += fmt::format(" {:.9g}", found->second[row] * coordinates[i].unitsPerSi());
        }
        text += "\n";
      }
      io::writeFileAtomically(out.file("plots/" + referenceFile), text);
    }
    writePlot(out, name, data, makeTimeScript(name, panels, calcTimeRange(trajectory.frames), referenceFile, referenceColumns));
    scripts.push_back(name + ".gp");
  }
  return scripts;
}

std::vector<std::string> writeElementPlots(OutputFolder& out, const scene::Trajectory& trajectory) {
  std::vector<std::string> keywords, scripts;
  for (const auto& column : trajectory.elementColumns) {
    if (keywords.empty() || keywords.back() != column.keyword) keywords.push_back(column.keyword);
  }
  std::sort(keywords.begin(), keywords.end());
  keywords.erase(std::unique(keywords.begin(), keywords.end()), keywords.end());
  for (const std::string& keyword : keywords) {
    // (largest force, column) of every element
    std::vector<std::pair<double, size_t>> ranked;
    for (size_t i = 0; i < trajectory.elementColumns.size(); ++i) {
      const scene::ElementColumn& column = trajectory.elementColumns[i];
      if (column.keyword != keyword || column.quantity != "force") continue;
      double largest = 0;
      for (const auto& frame : trajectory.frames) largest = std::max(largest, std::abs(frame.elements[i]));
      ranked.emplace_back(-largest, i);
    }
    if (ranked.empty()) continue;
    std::stable_sort(ranked.begin(), ranked.end());
    const size_t count = std::min<size_t>(ranked.size(), kMaxElementCurves);
    const bool more = ranked.size() > count;
    Panel force{more ? fmt::format("{} force (N), {} of {}", keyword, count, ranked.size()) : keyword + " force (N)", {}, true};
    Panel activation{"activation", {}, true};
    std::vector<size_t> columns;
    const auto addCurve = [&](Panel& panel, size_t index, size_t curve) {
      columns.push_back(index);
      panel.curves.push_back({trajectory.elementColumns[index].element, static_cast<int>(columns.size()) + 1, kColors[curve % kColors.size()],
                              curve < kColors.size() ? 1 : 2});
    };
    for (size_t k = 0; k < count; ++k) {
      const size_t index = ranked[k].second;
      addCurve(force, index, k);
      for (size_t i = index; i < trajectory.elementColumns.size() && trajectory.elementColumns[i].element == trajectory.elementColumns[index].element; ++i) {
        if (trajectory.elementColumns[i].quantity == "activation") addCurve(activation, i, k);
      }
    }
    std::string data = "# time_s";
    for (const size_t i : columns) data += " " + trajectory.elementColumns[i].label();
    data += "\n";
    for (const auto& frame : trajectory.frames) {
      data += fmt::format("{}", frame.time_s);
      for (const size_t i : columns) data += fmt::format(" {:.9g}", frame.elements[i]);
      data += "\n";
    }
    std::vector<Panel> panels = {force};
    if (!activation.curves.empty()) panels.push_back(activation);
    writePlot(out, keyword, data, makeTimeScript(keyword, panels, calcTimeRange(trajectory.frames)));
    scripts.push_back(keyword + ".gp");
  }
  return scripts;
}

std::vector<std::string> writeElementBars(OutputFolder& out, const scene::Trajectory& trajectory) {
  const std::vector<scene::ElementColumn>& columns = trajectory.elementColumns;
  const std::vector<double>& values = trajectory.frames.front().elements;
  std::vector<std::string> keywords, scripts;
  for (const auto& column : columns) {
    if (std::find(keywords.begin(), keywords.end(), column.keyword) == keywords.end()) keywords.push_back(column.keyword);
  }
  for (const std::string& keyword : keywords) {
    std::vector<Bar> bars;
    size_t total = 0;
    for (size_t i = 0; i < columns.size(); ++i) {
      if (columns[i].keyword != keyword || columns[i].quantity != "force") continue;
      ++total;
      if (values[i] == 0) continue;
      Bar bar{columns[i].element, values[i], fmt::format("{:.4g} N", values[i])};
      for (size_t k = i; k < columns.size() && columns[k].element == columns[i].element; ++k) {
        if (columns[k].quantity == "activation") bar.note += fmt::format(", activation {:.3g}", values[k]);
      }
      bars.push_back(std::move(bar));
    }
    if (bars.empty()) continue;
    std::stable_sort(bars.begin(), bars.end(), [](const Bar& a, const Bar& b) { return std::abs(a.value) > std::abs(b.value); });
    if (bars.size() > kMaxElementBars) bars.erase(bars.begin() + kMaxElementBars, bars.end());
    writeBars(out, keyword, bars.size() < total ? fmt::format("{} force (N), {} of {}", keyword, bars.size(), total) : keyword + " force (N)", bars);
    scripts.push_back(keyword + ".gp");
  }
  return scripts;
}

std::string writeForceBars(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory) {
  std::vector<Bar> bars;
  const std::vector<std::string> names = listCompartmentNames(scene);
  for (const auto& row : listLoads(scene, trajectory.frames.front().contacts)) {
    const double force_N = row.load.scalarForce_N;
    bars.push_back({names[bars.size()], force_N, fmt::format("{:.4g} N, peak {:.3g} MPa", force_N, row.load.peakPressure_Pa * 1e-6)});
  }
  writeBars(out, "forces", "contact force (N)", bars);
  return "forces.gp";
}

std::string writeForcePlot(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory) {
  const std::vector<std::string> names = listCompartmentNames(scene);
  Panel force{"contact force (N)", {}, true}, torque{"torque about fixed origin (N m)", {}, true};
  std::string header = "time_s";
  for (size_t i = 0; i <= names.size(); ++i) {
    if (i == names.size() && names.size() == 1) break;
    const std::string name = i < names.size() ? names[i] : "total";
    const char* color = i < names.size() ? kColors[i % kColors.size()] : "#333333";
    force.curves.push_back({name, static_cast<int>(2 * i) + 2, color, i < names.size() ? 1 : 4});
    torque.curves.push_back({name, static_cast<int>(2 * i) + 3, color, i < names.size() ? 1 : 4});
    header += " " + name + ".force_N " + name + ".torque_Nm";
  }
  writePlot(out, "forces",
            makeLoadData(scene, trajectory.frames, header,
                         [](const NetLoad& load) {
                           return std::array<double, 2>{load.scalarForce_N, load.momentOnM_Fo_F.norm()};
                         }),
            makeTimeScript("forces", {force, torque}, calcTimeRange(trajectory.frames)));
  return "forces.gp";
}

std::string writePressurePlot(OutputFolder& out, const scene::Scene& scene, const scene::Trajectory& trajectory) {
  const std::vector<std::string> names = listCompartmentNames(scene);
  Panel pressure{"contact pressure (MPa)", {}, true}, area{"contact area (mm²)", {}, true};
  std::string header = "time_s";
  for (size_t i = 0; i < names.size(); ++i) {
    const char* color = kColors[i % kColors.size()];
    const int column = static_cast<int>(3 * i) + 2;
    pressure.curves.push_back({names[i] + ", peak", column, color, 1});
    pressure.curves.push_back({names[i] + ", mean", column + 1, color, 2});
    area.curves.push_back({names[i], column + 2, color, 1});
    header += fmt::format(" {0}.peak_MPa {0}.mean_MPa {0}.area_mm2", names[i]);
  }
  writePlot(
      out, "pressures",
      makeLoadData(
          scene, trajectory.frames, header,
          [](const NetLoad& load) {
            return std::array<double, 3>{load.peakPressure_Pa * 1e-6, load.meanPressure_Pa * 1e-6, load.area_m2 * 1e6};
          }),
      makeTimeScript("pressures", {pressure, area}, calcTimeRange(trajectory.frames)));
  return "pressures.gp";
}

std::string writeMapPlot(OutputFolder& out, const std::string& name, const contact::ContactPairDefinition& definition,
                         const std::vector<MapPanel>& panels, bool leftKnee, bool anatomical) {
  // Extent of the compartments [mm] and the largest pressure [MPa] of all panels.
  double x0 = std::numeric_limits<double>::infinity(), z0 = x0, x1 = -x0, z1 = -x0;
  const auto isFlat = [&definition](const contact::CompartmentDefinition& c) {
    return std::holds_alternative<contact::ElementPlane>(c.elementSurface) && definition.gridOn == contact::GridOn::fixed;
  };
  // Half the edge of a square that covers as much of the x-z plane as an element does [mm].
  const auto calcHalfEdge = [](const contact::ElementField& e) { return 500 * std::sqrt(e.area_m2 * std::abs(e.normal_F.y())); };
  // Middle of a compartment's elements along z [mm].
  const auto calcMiddle = [&](size_t c, const std::vector<contact::ElementField>& fields) {
    const contact::CompartmentDefinition& part = definition.compartments[c];
    if (isFlat(part) || fields.empty()) return 500 * (part.z0_m + part.z1_m);
    const auto byZ = [](const contact::ElementField& a, const contact::ElementField& b) { return a.p_FA.z() < b.p_FA.z(); };
    const auto ends = std::minmax_element(fields.begin(), fields.end(), byZ);
    return 500 * (ends.first->p_FA.z() + ends.second->p_FA.z());
  };
  // Half the edges of the rectangle that shows an element [mm]: on a round grid that of the box from its neighbours' centres, which
  // leaves no gaps; each row of the grid is a run of elements with one ix.
  const auto calcHalfEdges = [&](const std::vector<contact::ElementField>& fields, size_t e) {
    const auto spread = [&](int dx, int dz) -> Vec3 {
      const int wantX = fields[e].ix + dx, wantZ = fields[e].iz + dz;
      const auto at = std::lower_bound(fields.begin(), fields.end(), std::pair(wantX, wantZ), [](const auto& f, const auto& cell) {
        return std::pair(f.ix, f.iz) < cell;
      });
      if (at == fields.end() || at->ix != wantX || at->iz != wantZ) return Vec3::Zero();
      return (at->p_FA - fields[e].p_FA).cwiseAbs();
    };
    const Vec3 along = spread(1, 0).cwiseMax(spread(-1, 0)), across = spread(0, 1).cwiseMax(spread(0, -1));
    const double half = calcHalfEdge(fields[e]);
    if (along.isZero(0) || across.isZero(0)) return std::pair(half, half);
    return std::pair(500 * (along.x() + across.x()), 500 * (along.z() + across.z()));
  };
  for (size_t c = 0; c < definition.compartments.size(); ++c) {
    if (isFlat(definition.compartments[c])) continue;
    for (const auto& panel : panels) {
      for (const auto& e : panel.fields[c]) {
        const double half = calcHalfEdge(e);
        x0 = std::min(x0, e.p_FA.x() * 1e3 - half), x1 = std::max(x1, e.p_FA.x() * 1e3 + half);
        z0 = std::min(z0, e.p_FA.z() * 1e3 - half), z1 = std::max(z1, e.p_FA.z() * 1e3 + half);
      }
    }
  }
  for (const auto& c : definition.compartments) {
    if (!isFlat(c)) continue;
    x0 = std::min(x0, c.x0_m * 1e3), x1 = std::max(x1, c.x1_m * 1e3);
    z0 = std::min(z0, c.z0_m * 1e3), z1 = std::max(z1, c.z1_m * 1e3);
  }
  const double margin = 0.03 * std::max(x1 - x0, z1 - z0);
  x0 -= margin, x1 += margin, z0 -= margin, z1 += margin;
  double peak = 0;
  for (const auto& panel : panels) {
    for (const auto& load : panel.loads) peak = std::max(peak, load.peakPressure_Pa * 1e-6);
  }

  std::vector<std::string> blocks(panels.size());
  for (size_t p = 0; p < panels.size(); ++p) {
    std::string data = "# z_mm x_mm half_dz_mm half_dx_mm pressure_MPa\n";
    for (size_t c = 0; c < panels[p].fields.size(); ++c) {
      const auto& compartment = definition.compartments[c];
      const double dx = 500 * (compartment.x1_m - compartment.x0_m) / compartment.nx;
      const double dz = 500 * (compartment.z1_m - compartment.z0_m) / compartment.nz;
      const bool flat = isFlat(compartment);
      for (size_t i = 0; i < panels[p].fields[c].size(); ++i) {
        const contact::ElementField& e = panels[p].fields[c][i];
        const auto [halfX, halfZ] = flat ? std::pair(dx, dz) : calcHalfEdges(panels[p].fields[c], i);
        data += fmt::format("{:.6g} {:.6g} {:.6g} {:.6g} {:.6g}\n", e.p_FA.z() * 1e3, e.p_FA.x() * 1e3,
                            halfZ, halfX, e.p_Pa * 1e-6);
      }
    }
    io::writeFileAtomically(out.file(fmt::format("plots/{}_{}.dat", name, p + 1)), data);
  }

  // Pixels: panels of equal scale on both axes, in rows of at most three; a single panel is larger.
  const int count = static_cast<int>(panels.size());
  const int columns = std::min(count, 3), rows = (count + columns - 1) / columns;
  const double pixelsPerMm = (count == 1 ? 640.0 : 400.0) / std::max(z1 - z0, 1.2 * (x1 - x0));
  const double w = pixelsPerMm * (z1 - z0), h = pixelsPerMm * (x1 - x0);
  const double left = 95, right = 25, top = 58, bottom = 75;
  const double cellW = left + w + right, cellH = top + h + bottom;
  const bool freeCell = count < columns * rows;  // the colour bar goes into the empty cell, or below
  const double barSpace = freeCell ? 0 : 115;
  const double W = std::max(columns * cellW, 620.0), H = rows * cellH + barSpace;
  const double barW = std::min(0.7 * (freeCell ? cellW : W), 420.0);
  const double barX = freeCell ? (columns - 0.5) * cellW - barW / 2 : (W - barW) / 2;
  const double barY = freeCell ? 0.5 * cellH : 72;

  std::string script = fmt::format(
      "# Draw again with: gnuplot {0}.gp\n"
      "set terminal pngcairo size {1:.0f},{2:.0f} font 'DejaVu Sans,13' background rgb 'white' noenhanced\n"
      "set output '{0}.png'\n{3}unset grid\nunset key\n"
      "set palette defined (0 '#440154', 1 '#46327e', 2 '#365c8d', 3 '#277f8e', 4 '#1fa187', 5 '#4ac16d', 6 '#a0da39', "
      "7 "
      "'#fde725')\n"
      "set cbrange [0:{4:.6g}]\n"
      "set style fill solid 1.0 border\n"
      "set multiplot\n",
      name, W, H, kCommon, peak > 0 ? peak : 1.0);
  // Seen from above (along -y). Right knee: x posterior, so anterior is up at -x and medial (+z) is to the left.
  script += leftKnee ? fmt::format("set xrange [{}:{}]\nset yrange [{}:{}]\n", z0, z1, x0, x1)
                     : fmt::format("set xrange [{}:{}]\nset yrange [{}:{}]\n", z1, z0, x1, x0);
  script +=
      leftKnee ? "set xlabel '← lateral    z (mm)    medial →'\n" : "set xlabel '← medial    z (mm)    lateral →'\n";
  if (!anatomical) script += "set xlabel 'z (mm)'\nset ylabel 'x (mm)'\n";
  else script += h > 270 ? "set ylabel '← posterior    x (mm)    anterior →'\n" : "set ylabel 'x (mm)    anterior →'\n";
  for (int p = 0; p < count; ++p) {
    const MapPanel& panel = panels[static_cast<size_t>(p)];
    const double px = (p % columns) * cellW + (columns * cellW < W ? (W - cellW) / 2 : 0) + left;
    const double py = H - (p / columns) * cellH - top;  // upper edge
    script += fmt::format(
        "\nset lmargin at screen {:.5f}\nset rmargin at screen {:.5f}\nset tmargin at screen {:.5f}\nset bmargin at "
        "screen "
        "{:.5f}\n",
        px / W, (px + w) / W, py / H, (py - h) / H);
    script += "unset label\n";
    for (size_t c = 0; c < panel.loads.size(); ++c) {
      const auto& compartment = definition.compartments[c];
      // Inside the panel's upper edge, over the middle of its compartment.
      script += fmt::format("set label {} at first {:.4g}, graph 0.90 center front font ',11' tc rgb '#202020'\n",
                            quote(fmt::format("{} {:.0f} N", compartment.name, panel.loads[c].scalarForce_N)),
                            calcMiddle(c, panel.fields[c]));
    }
    script += fmt::format("set title {} offset 0,-0.3\n", quote(panel.title));
    if (p + 1 < count) {
      script += "unset colorbox\n";
    } else {
      script += fmt::format(
          "set colorbox horizontal user origin {:.5f},{:.5f} size {:.5f},{:.5f} noinvert\nset cblabel 'contact "
          "pressure "
          "(MPa)' offset 0,0.2\n",
          barX / W, barY / H, barW / W, 22.0 / H);
      script += fmt::format(
          "set label 101 'seen along -y; grey: elements out of contact; + center of pressure' at screen "
          "{:.5f},{:.5f} "
          "center font ',11' tc rgb '#404040'\n",
          (barX + barW / 2) / W, (barY + 40) / H);
    }
    const std::string file = fmt::format("'{}_{}.dat'", name, p + 1);
    script += fmt::format(
        "plot {0} using 1:2:3:4 with boxxyerror lc rgb '#e4e4e4' notitle, \\\n"
        "     {0} using 1:2:($5 > 0 ? $3 : NaN):4:5 with boxxyerror lc palette notitle",
        file);
    std::string points;
    for (const auto& load : panel.loads) {
      if (load.activeElements == 0) continue;
      points += fmt::format("{:.6g} {:.6g}\n", load.centerOfPressure_F.z() * 1e3, load.centerOfPressure_F.x() * 1e3);
    }
    if (!points.empty()) {
      script += fmt::format(
          ", \\\n     $cop{0} using 1:2 with points pt 1 ps 2.2 lw 5 lc rgb 'white' notitle, \\\n"
          "     $cop{0} using 1:2 with points pt 1 ps 2 lw 2 lc rgb 'black' notitle",
          p + 1);
      // Inline data must come before the plot command that names it.
      const size_t at = script.rfind("\nplot ");
      script.insert(at, fmt::format("\n$cop{} << END\n{}END", p + 1, points));
    }
    script += "\n";
  }
  io::writeFileAtomically(out.file("plots/" + name + ".gp"), script + "\nunset multiplot\n");
  return name + ".gp";
}

}  // namespace genu::report
