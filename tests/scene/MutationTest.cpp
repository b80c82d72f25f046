#include <random>

#include "../fuzz/Mutate.h"
#include "../fuzz/Targets.h"
#include "TestFiles.h"
#include "genu/io/Files.h"

namespace genu::fuzz {
namespace {

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
                                         Case{"scene/elements.yaml", readSceneText, 1000},
                                         Case{"csv/a.csv", readCsvText, 5000}, Case{"sto/a.sto", readStoText, 5000},
                                         Case{"nurbs/a.json", readNurbsText, 5000},
                                         Case{"units/a.txt", readUnitsText, 5000},
                                         Case{"units/pose.txt", readUnitsText, 5000}));

}  // namespace
}  // namespace genu::fuzz
