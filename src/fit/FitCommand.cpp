#include "genu/fit/FitCommand.h"

#include <cstdio>

#include "genu/io/Units.h"
#include "genu/scene/Scene.h"

namespace genu::fit {

namespace {

using io::Dimension;

std::vector<std::string> splitExactly(const std::string& text, size_t count, const std::string& form,
                                      const std::string& where) {
  std::vector<std::string> parts = io::splitList(text);
  if (parts.size() != count) {
    throw InputError(where + ": \"" + text + "\" has " + std::to_string(parts.size()) + " values; needed: \"" + form +
                     "\"");
  }
  return parts;
}

Vec3 parsePoint(const std::string& text, const std::string& where) {
  const auto parts = splitExactly(text, 3, "x, y, z", where);
  Vec3 p;
  for (int i = 0; i < 3; ++i) p[i] = io::parseQuantity(parts[static_cast<size_t>(i)], Dimension::length, where);
  return p;
}

Box parseBox(const std::string& text, const std::string& where) {
  const auto parts = splitExactly(text, 6, "x0, x1, y0, y1, z0, z1", where);
  Box box;
  for (size_t i = 0; i < 3; ++i) {
    const auto bound = [&](const std::string& part) -> std::optional<double> {
      if (part == "*") return std::nullopt;
      return io::parseQuantity(part, Dimension::length, where);
    };
    box.min[i] = bound(parts[2 * i]);
    box.max[i] = bound(parts[2 * i + 1]);
    if (box.min[i] && box.max[i] && !(*box.min[i] < *box.max[i])) {
      throw InputError(where + ": \"" + parts[2 * i] + ", " + parts[2 * i + 1] +
                       "\": the first bound must be the lower one");
    }
  }
  return box;
}

Pose parsePose(const std::string& text, const std::string& where) {
  const auto parts = splitExactly(text, 6, "rx, ry, rz, x, y, z", where);
  contact::JointCoordinates q{};
  for (size_t i = 0; i < 6; ++i)
    q[i] = io::parseQuantity(parts[i], i < 3 ? Dimension::angle : Dimension::length, where);
  return contact::calcPose(q);
}

std::array<int, 2> parseCounts(const std::string& text, const std::string& where) {
  int u = 0, v = 0, used = 0;
  if (std::sscanf(text.c_str(), "%d%*1[xX]%d%n", &u, &v, &used) != 2 || used != static_cast<int>(text.size()) ||
      u < 4 || v < 4 || u > 200 || v > 200) {
    throw InputError(where + ": \"" + text + "\"; allowed: UxV with both from 4 to 200, such as 20x15");
  }
  return {u, v};
}

template <class T>
T chooseWord(const std::string& text, const std::vector<std::pair<const char*, T>>& words, const std::string& where) {
  std::string allowed;
  for (const auto& [word, value] : words) {
    if (text == word) return value;
    allowed += (allowed.empty() ? "" : ", ") + std::string(word);
  }
  throw InputError(where + ": \"" + text + "\"; allowed: " + allowed);
}

}  // namespace

void addFitOptions(CLI::App& app, FitOptions& o) {
  const auto add = [&app](const char* name, const char* help, const char* form, auto&& set) {
    app.add_option_function<std::string>(
           name, [set](const std::string& text) { set(text); }, help)
        ->type_name(form);
  };
  app.add_option("mesh", o.mesh, "Open triangle mesh: .stl, .obj or .vtp")->required()->type_name("MESH");
  app.add_option("-o,--output", o.outputDir, "Folder for the results (made if missing)")->type_name("DIR");
  app.add_option("--name", o.name, "Name of the patch and its files; default: the mesh's name")->type_name("NAME");
  add("--unit", "Length unit of the mesh; default: guessed from its size and reported", "m|mm",
      [&o](const std::string& s) {
        o.unit = chooseWord<LengthUnit>(s, {{"m", LengthUnit::m}, {"mm", LengthUnit::mm}}, "--unit");
      });
  add("--shape", "plateau (laid out along x and z) or condyle (by angle about z, and z); default plateau", "SHAPE",
      [&o](const std::string& s) {
        o.fit.parametrization.shape =
            chooseWord<PatchShape>(s, {{"plateau", PatchShape::plateau}, {"condyle", PatchShape::condyle}}, "--shape");
      });

  add("--transform", "Pose of the mesh's frame in the output frame, \"rx, ry, rz, x, y, z\" with units", "POSE",
      [&o](const std::string& s) { o.transform = parsePose(s, "--transform"); });
  add("--frame", "file (as it is), bbox (artificial knee) or landmarks (natural knee); default file", "FRAME",
      [&o](const std::string& s) {
        o.frame = chooseWord<FrameChoice>(
            s, {{"file", FrameChoice::file}, {"bbox", FrameChoice::boundingBox}, {"landmarks", FrameChoice::landmarks}},
            "--frame");
      });
  add("--axes", "z-medial (as the paper) or z-lateral (half a turn about y); default z-medial", "AXES",
      [&o](const std::string& s) {
        o.axes = chooseWord<FileAxes>(s, {{"z-medial", FileAxes::paper}, {"z-lateral", FileAxes::lateral}}, "--axes");
      });
  add("--side", "right or left knee, for --frame landmarks; default right", "SIDE", [&o](const std::string& s) {
    o.side = chooseWord<KneeSide>(s, {{"right", KneeSide::right}, {"left", KneeSide::left}}, "--side");
  });
  add("--reference-y", "Height of the origin in the mesh, for --frame bbox; default: the bottom", "LENGTH",
      [&o](const std::string& s) { o.referenceY_m = io::parseQuantity(s, Dimension::length, "--reference-y"); });
  const std::pair<const char*, std::optional<Vec3>*> points[] = {
      {"medial", &o.landmarks.medial},       {"lateral", &o.landmarks.lateral},   {"anterior", &o.landmarks.anterior},
      {"posterior", &o.landmarks.posterior}, {"superior", &o.landmarks.superior}, {"inferior", &o.landmarks.inferior},
      {"center", &o.landmarks.center}};
  for (const auto& [name, target] : points) {
    const std::string option = std::string("--") + name;
    add(option.c_str(), "Landmark in the mesh's frame, \"x, y, z\" with units", "POINT",
        [target = target, option](const std::string& s) { *target = parsePoint(s, option); });
  }

  add("--box", "Region, \"x0, x1, y0, y1, z0, z1\" with units in the output frame; * is open", "BOX",
      [&o](const std::string& s) { o.box = parseBox(s, "--box"); });
  app.add_option_function<int>(
         "--component", [&o](const int& i) { o.component = i; }, "Piece of the mesh: 0 is the largest")
      ->type_name("INDEX");
  add("--angles", "Condyle: range kept, \"from, to\"; 0 is distal (-y), growing towards +x", "ANGLES",
      [&o](const std::string& s) {
        const auto parts = splitExactly(s, 2, "from, to", "--angles");
        o.angles_rad = {io::parseQuantity(parts[0], Dimension::angle, "--angles"),
                        io::parseQuantity(parts[1], Dimension::angle, "--angles")};
        if (!((*o.angles_rad)[0] < (*o.angles_rad)[1]))
          throw InputError("--angles: \"" + s + "\": the first must be the lower one");
      });
  add("--axis", "Condyle: x and y of the axis, \"x, y\"; default: fitted circle", "POINT", [&o](const std::string& s) {
    const auto parts = splitExactly(s, 2, "x, y", "--axis");
    o.axis_m = Vec2(io::parseQuantity(parts[0], Dimension::length, "--axis"),
                    io::parseQuantity(parts[1], Dimension::length, "--axis"));
  });
  app.add_option("--min-normal", o.minNormal, "Triangles kept: cosine to the up or radial direction; default 0.15")
      ->type_name("COSINE");
  app.add_flag("--flip", o.flipMesh, "The mesh's normals point inwards: turn them");

  add("--max-points", "Cap on control points, UxV; default 20x15", "UxV", [&o](const std::string& s) {
    const auto counts = parseCounts(s, "--max-points");
    o.fit.maxPointsU = counts[0];
    o.fit.maxPointsV = counts[1];
    o.fit.minPointsU = std::min(o.fit.minPointsU, counts[0]);
    o.fit.minPointsV = std::min(o.fit.minPointsV, counts[1]);
  });
  add("--tolerance-mean", "Mean deviation asked for; default \"0.005 mm\"", "LENGTH", [&o](const std::string& s) {
    o.fit.toleranceMean_m = io::parseQuantity(s, Dimension::length, "--tolerance-mean");
  });
  add("--tolerance-max", "Largest deviation asked for; default \"0.05 mm\"", "LENGTH", [&o](const std::string& s) {
    o.fit.toleranceMax_m = io::parseQuantity(s, Dimension::length, "--tolerance-max");
  });
  app.add_option("--fairing", o.fit.fairing, "Weight of the thin-plate energy; default 1e-9")->type_name("WEIGHT");
  add("--fall-away", "Radius with which the patch bends away from contact beyond the mesh; inf: not; default \"15 mm\"",
      "LENGTH", [&o](const std::string& s) {
        o.fit.fallAwayRadius_m = io::parseQuantityOrInfinity(s, Dimension::length, "--fall-away");
        if (!(o.fit.fallAwayRadius_m > 0))
          throw InputError("--fall-away: \"" + s + "\"; allowed: greater than 0 mm, or inf");
      });
  add("--contact-box", "Second set of deviations, over this part of the region; as --box", "BOX",
      [&o](const std::string& s) { o.contactBox = parseBox(s, "--contact-box"); });
  app.add_flag("--vtp", o.writeVtp, "Write the region with its deviations as .vtp");
  app.add_flag("!--no-picture", o.picture, "Do not draw the deviation map");
}

void runFitCommand(const FitOptions& options, const scene::Progress& progress) {
  std::fputs(formatReport(runFit(options, progress)).c_str(), stdout);
}

}  // namespace genu::fit
