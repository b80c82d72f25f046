#include <CLI/CLI.hpp>
#include <exception>
#include <filesystem>
#include <iostream>

#include "Models.h"

/** Writes the NURBS files of the shipped models; the scenes, tables and URDF files beside them are written by hand. */
int main(int argc, char** argv) {
  CLI::App app("Writes the surfaces of the shipped knee models (NURBS, JSON) and prints how well they fit.",
               "genu_make_models");
  std::filesystem::path output;
  app.add_option("OUTPUT_DIR", output, "folder for artificial_knee/ and natural_knee/; models/ in the source")
      ->required();
  CLI11_PARSE(app, argc, argv);
  try {
    for (const char* model : {"artificial_knee", "natural_knee"}) std::filesystem::create_directories(output / model);
    genu::make_models::makeArtificialKnee(output / "artificial_knee", std::cout);
    genu::make_models::makeNaturalKnee(output / "natural_knee", std::cout);
  } catch (const std::exception& error) {
    std::cerr << "genu_make_models: " << error.what() << '\n';
    return 3;
  }
  return 0;
}
