#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <iostream>

#include "Models.h"

/** Writes the NURBS files of the shipped models, and scenes, tables and URDF files of those with ligaments; the other
 scenes, tables and URDF files are written by hand. */
int main(int argc, char** argv) {
  CLI::App app(
      "Writes the surfaces of the shipped knee models (NURBS, JSON), prints how well they fit, and writes the scenes "
      "of "
      "those with ligaments and muscles.",
      "genu_make_models");
  std::filesystem::path output;
  app.add_option("OUTPUT_DIR", output, "folder for the models' folders; models/ in the source")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    for (const char* model : {"artificial_knee", "natural_knee", "knee_with_ligaments", "musculoskeletal_knee"}) {
      std::filesystem::create_directories(output / model);
    }
    genu::make_models::makeArtificialKnee(output / "artificial_knee", std::cout);
    genu::make_models::makeNaturalKnee(output / "natural_knee", std::cout);
    genu::make_models::makePatellofemoralJoint(output / "knee_with_ligaments", std::cout);
    genu::make_models::makeKneeWithLigaments(output / "knee_with_ligaments");
    genu::make_models::makeMusculoskeletalKnee(output / "musculoskeletal_knee");
  } catch (const std::exception& error) {
    std::cerr << "genu_make_models: " << error.what() << '\n';
    return 3;
  }
  return 0;
}
