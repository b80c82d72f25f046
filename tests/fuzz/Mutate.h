#pragma once

#include <random>
#include <string>

namespace genu::fuzz {

/** Cuts, repeats, swaps and alters parts of a text. */
inline std::string mutate(std::string text, std::mt19937& random) {
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

/** Alters digits and signs of a text: mostly still a scene, with other numbers. */
inline std::string mutateNumbers(std::string text, std::mt19937& random) {
  const auto pick = [&random](size_t below) { return std::uniform_int_distribution<size_t>(0, below - 1)(random); };
  const std::string characters = "0123456789";
  const int edits = 1 + static_cast<int>(pick(4));
  for (int i = 0; i < edits;) {
    const size_t at = text.find_first_of(characters, pick(text.size()));
    if (at == std::string::npos) continue;
    ++i;
    switch (pick(4)) {
      case 0:
        text.insert(at, 1, characters[pick(characters.size())]);
        break;
      case 1:
        text.insert(at, "-");
        break;
      default:
        text[at] = characters[pick(characters.size())];
    }
  }
  return text;
}

}  // namespace genu::fuzz
