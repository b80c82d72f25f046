#include "DeviationPicture.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "genu/io/Files.h"
#include "genu/io/Units.h"
#include "genu/report/Gnuplot.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace fs = std::filesystem;

std::string drawDeviation(const FitReport& report, const TriangleMesh& region, const Box& contactBox,
                          const fs::path& pngFile) {
  const bool condyle = report.parametrization.shape == PatchShape::condyle;
  std::ostringstream data;
  data.precision(9);
  for (size_t i = 0; i < region.vertices.size(); ++i) {
    const Vec3& p = region.vertices[i];
    const double across = condyle ? report.parametrization.calcAngle(p) * 180 / contact::kPi : p.x() * 1e3;
    data << across << ' ' << p.z() * 1e3 << ' ' << report.result.deviation_m[i] * 1e6 << ' '
         << (report.contact && contactBox.contains(p) ? 1 : 0) << '\n';
  }
  // Points that nearly touch, so that holes show and the map reads as an area.
  const double size = std::clamp(45.0 / std::sqrt(static_cast<double>(region.numVertices())), 0.25, 1.2);
  // Color range: 95 % of the vertices, so that a rim does not drown the rest; the title tells the maximum.
  const double range = std::max(0.1, report.all.percentile95_m * 1e6);
  std::ostringstream script;
  script << "set terminal pngcairo size 1100,800 font 'sans,12' noenhanced\n"
         << "set output 'map.png'\n"
         << "set title \"" << report.name << ": " << report.controlPoints[0] << " x " << report.controlPoints[1]
         << " control points; deviation max " << io::formatQuantity(report.all.max_m, "um", 3) << ", mean "
         << io::formatQuantity(report.all.mean_m, "um", 3) << ", sd " << io::formatQuantity(report.all.sd_m, "um", 3)
         << "\"\n"
         << "set xlabel '" << (condyle ? "angle about the axis, 0 distal, towards +x [deg]" : "x [mm]") << "'\n"
         << "set ylabel 'z [mm]'\nset cblabel 'mesh above the patch (95 % of vertices in range) [um]'\n"
         << "set palette defined (-1 '#053061', -0.5 '#4393c3', 0 '#f2f2f2', 0.5 '#d6604d', 1 '#67001f')\n"
         << "set cbrange [" << -range << ":" << range << "]\n"
         << (condyle ? "" : "set size ratio -1\n") << "set grid lc rgb '#d0d0d0'\n"
         << "set object 1 rectangle from graph 0,0 to graph 1,1 fc rgb '#c8c8c8' behind\n"
         << "plot 'map.dat' using 1:2:3 with points pt 7 ps " << size << " lc palette notitle";
  if (report.contact) script << ", '' using ($4 > 0 ? $1 : NaN):2 with dots lc rgb '#000000' title 'contact box'";
  script << "\n";

  const fs::path folder = pngFile.parent_path() / ("." + pngFile.stem().string() + "_picture");
  io::writeFileAtomically(folder / "map.dat", data.str());
  io::writeFileAtomically(folder / "map.gp", script.str());
  const report::DrawResult drawn = report::runGnuplot(folder, {"map.gp"});
  std::string problem = drawn.problem.substr(0, drawn.problem.find(';'));
  std::error_code error;
  if (problem.empty()) {
    fs::rename(folder / "map.png", pngFile, error);
    if (error) problem = error.message();
  }
  fs::remove_all(folder, error);
  return problem;
}

}  // namespace genu::fit
