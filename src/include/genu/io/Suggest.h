#pragma once

#include <string>
#include <vector>

namespace genu::io {

/** Smallest number of insertions, deletions, substitutions and swaps of neighbours, ignoring case. */
int calcEditDistance(const std::string& a, const std::string& b);

/** The candidate nearest to `name`, or empty when none is near enough to be meant (more than a third of it, and more
 than two letters, would have to change). */
std::string findNearest(const std::string& name, const std::vector<std::string>& candidates);

/** Text for a message: `unknown link "tibbia" (did you mean "tibia"?); known: femur, tibia`. */
std::string describeUnknown(const std::string& kind, const std::string& name,
                            const std::vector<std::string>& candidates);

/** "a, b, c", or "none" */
std::string joinNames(const std::vector<std::string>& names);

}  // namespace genu::io
