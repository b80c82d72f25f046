#include <functional>
#include <random>

#include "../fuzz/Targets.h"
#include "TestFiles.h"
#include "genu/io/Files.h"

namespace genu::fuzz {
namespace {

/** Cuts, repeats, swaps and alters parts of a text. */
std::string mutate(std::string text, std::mt19937& random) {
  const auto pick = [&random](size_t below) { return std::uniform_int_distribution<size_t>(0, below - 1)(random); };
  const std::string characters = "{}[]:,#\"'&*|>-.0159eEnimN \n\t\r\\/%~!@\xc2\xff";
  const int edits = 1 + static_cast<int>(pick(4));
  for (int i = 0; i < edits && !text.empty(); ++i) {
    const size_t at = pick(text.size()), length = 1 + pick(12);
    switch (pick(5)) {
      case 0:
        text.erase(at, length);
        break;
      case 1:
        text.insert(at, text.substr(pick(text.size()), length));
        break;
      case 2:
        text[at] = characters[pick(characters.size())];
        break;
      case 3:
        text.insert(at, 1, characters[pick(characters.size())]);
        break;
      default:
        text.resize(at);
    }
  }
  return text;
}

struct Case {
  const char* seed;
  void (*read)(const std::string&);
  int runs;
};

class Mutation : public testing::TestWithParam<Case> {};

// A small stand-in for the fuzz programs that every compiler can run: any exception other than InputError fails.
TEST_P(Mutation, WrongTextIsAnInputError) {
  const std::string seed =
      io::readFile(std::filesystem::path(GENU_SOURCE_DIR) / "tests" / "fuzz" / "corpus" / GetParam().seed);
  std::mt19937 random(20240229);
  for (int i = 0; i < GetParam().runs; ++i) {
    const std::string text = mutate(seed, random);
    ASSERT_NO_THROW(GetParam().read(text)) << text;
  }
}

INSTANTIATE_TEST_SUITE_P(Inputs, Mutation,
                         testing::Values(Case{"scene/sphere.yaml", readSceneText, 1000},
                                         Case{"csv/a.csv", readCsvText, 5000}, Case{"sto/a.sto", readStoText, 5000},
                                         Case{"nurbs/a.json", readNurbsText, 5000},
                                         Case{"units/a.txt", readUnitsText, 5000},
                                         Case{"units/pose.txt", readUnitsText, 5000}));

}  // namespace
}  // namespace genu::fuzz
