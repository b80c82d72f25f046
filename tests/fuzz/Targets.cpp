#include "Targets.h"

#include "genu/io/NurbsFile.h"
#include "genu/io/Table.h"
#include "genu/io/Units.h"
#include "genu/scene/SceneFile.h"

namespace genu::fuzz {

namespace {

template <class Function>
void swallowInputError(Function function) {
  try {
    function();
  } catch (const InputError&) {
  }
}

}  // namespace

void readSceneText(const std::string& text) {
  // Of the files that the text names only leg.urdf is there; the scene's reader does not open it.
  swallowInputError([&text] { scene::parseScene(text, GENU_SOURCE_DIR "/tests/fuzz/files/scene.yaml"); });
}

void readCsvText(const std::string& text) {
  swallowInputError([&text] { io::parseTable(text, "table.csv"); });
}

void readStoText(const std::string& text) {
  swallowInputError([&text] { io::parseTable(text, "table.sto"); });
}

void readNurbsText(const std::string& text) {
  swallowInputError([&text] { io::parseNurbs(text, "surface.json"); });
}

void readUnitsText(const std::string& text) {
  using io::Dimension;
  for (int d = 0; d <= static_cast<int>(Dimension::angularDamping); ++d) {
    swallowInputError([&text, d] { io::parseQuantity(text, static_cast<Dimension>(d), "key"); });
    swallowInputError([&text, d] { io::parseQuantityOrInfinity(text, static_cast<Dimension>(d), "key"); });
    swallowInputError([&text, d] { io::parseScaledUnit("2 N", text, static_cast<Dimension>(d), "key"); });
  }
  swallowInputError([&text] { scene::parsePose(text); });
  swallowInputError([&text] { scene::parseGrid(text); });
}

}  // namespace genu::fuzz
