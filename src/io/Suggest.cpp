#include "genu/io/Suggest.h"

#include <algorithm>
#include <cctype>
#include <limits>

namespace genu::io {

namespace {

/** Longer names are cut: the table below is quadratic, and no key is that long. */
std::string toLowerCut(const std::string& text) {
  std::string lower = text.substr(0, 80);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return lower;
}

}  // namespace

int calcEditDistance(const std::string& first, const std::string& second) {
  const std::string a = toLowerCut(first), b = toLowerCut(second);
  const size_t n = a.size(), m = b.size();
  std::vector<std::vector<int>> cost(n + 1, std::vector<int>(m + 1));
  for (size_t i = 0; i <= n; ++i) cost[i][0] = static_cast<int>(i);
  for (size_t j = 0; j <= m; ++j) cost[0][j] = static_cast<int>(j);
  for (size_t i = 1; i <= n; ++i) {
    for (size_t j = 1; j <= m; ++j) {
      const int substitution = cost[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      cost[i][j] = std::min({cost[i - 1][j] + 1, cost[i][j - 1] + 1, substitution});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) cost[i][j] = std::min(cost[i][j], cost[i - 2][j - 2] + 1);
    }
  }
  return cost[n][m];
}

std::string findNearest(const std::string& name, const std::vector<std::string>& candidates) {
  std::string nearest;
  int smallest = std::max(2, static_cast<int>(name.size()) / 3) + 1;
  for (const std::string& candidate : candidates) {
    const int distance = calcEditDistance(name, candidate);
    // A name of two letters is two changes away from anything: something of it must remain.
    const int longest = static_cast<int>(std::max(name.size(), candidate.size()));
    if (distance < smallest && distance < longest) {
      smallest = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

std::string joinNames(const std::vector<std::string>& names) {
  if (names.empty()) return "none";
  std::string joined;
  for (const std::string& name : names) joined += (joined.empty() ? "" : ", ") + name;
  return joined;
}

std::string describeUnknown(const std::string& kind, const std::string& name,
                            const std::vector<std::string>& candidates) {
  std::string text = "unknown " + kind + " \"" + name.substr(0, 80) + "\"";
  const std::string nearest = findNearest(name, candidates);
  if (!nearest.empty()) text += " (did you mean \"" + nearest + "\"?)";
  return text + "; known: " + joinNames(candidates);
}

}  // namespace genu::io
