#include "genu/io/Units.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <stdexcept>

#include "genu/contact/Types.h"
#include "genu/io/Suggest.h"

namespace genu::io {

namespace {

/** Powers of length, mass, time and angle. Angle counts as a dimension here so that "8 mm" is no angle. */
using Powers = std::array<int, 4>;

struct Unit {
  double si = 1;
  Powers powers{};
};

struct Symbol {
  const char* name;
  Unit unit;
};

constexpr Powers kNone = {0, 0, 0, 0}, kLength = {1, 0, 0, 0}, kMass = {0, 1, 0, 0}, kTime = {0, 0, 1, 0},
                 kAngle = {0, 0, 0, 1}, kForce = {1, 1, -2, 0}, kPressure = {-1, 1, -2, 0}, kEnergy = {2, 1, -2, 0};

// Values are written as quotients or literals that are correctly rounded, so "8 mm" is the double nearest to 0.008.
constexpr std::array<Symbol, 29> kSymbols = {{
    {"m", {1, kLength}},
    {"mm", {1e-3, kLength}},
    {"cm", {1e-2, kLength}},
    {"um", {1e-6, kLength}},
    {"\u00b5m", {1e-6, kLength}},
    {"\u03bcm", {1e-6, kLength}},
    {"kg", {1, kMass}},
    {"g", {1e-3, kMass}},
    {"t", {1e3, kMass}},
    {"s", {1, kTime}},
    {"ms", {1e-3, kTime}},
    {"min", {60, kTime}},
    {"rad", {1, kAngle}},
    {"deg", {contact::kPi / 180, kAngle}},
    {"\u00b0", {contact::kPi / 180, kAngle}},
    {"N", {1, kForce}},
    {"kN", {1e3, kForce}},
    {"mN", {1e-3, kForce}},
    {"Pa", {1, kPressure}},
    {"kPa", {1e3, kPressure}},
    {"MPa", {1e6, kPressure}},
    {"GPa", {1e9, kPressure}},
    {"J", {1, kEnergy}},
    {"Nm", {1, kEnergy}},
    {"Nmm", {1e-3, kEnergy}},
    {"kNm", {1e3, kEnergy}},
    {"%", {1e-2, kNone}},
    {"percent", {1e-2, kNone}},
    {"1", {1, kNone}},
}};

struct DimensionInfo {
  Dimension dimension;
  const char* name;
  Powers powers;
  const char* accepted;
  const char* example;
};

constexpr std::array<DimensionInfo, 20> kDimensions = {{
    {Dimension::dimensionless, "number", kNone, "none (a bare number), %", "0.46"},
    {Dimension::length, "length", kLength, "mm, cm, m, um", "8 mm"},
    {Dimension::angle, "angle", kAngle, "deg, rad", "30 deg"},
    {Dimension::time, "time", kTime, "s, ms, min", "1 s"},
    {Dimension::mass, "mass", kMass, "kg, g, t", "70 kg"},
    {Dimension::force, "force", kForce, "N, kN", "1000 N"},
    {Dimension::moment, "moment", kEnergy, "N m, N mm, kN m", "2 N m"},
    {Dimension::pressure, "pressure", kPressure, "MPa, kPa, Pa, GPa, N/mm^2", "463 MPa"},
    {Dimension::speed, "speed", {1, 0, -1, 0}, "m/s, mm/s", "10 mm/s"},
    {Dimension::angularSpeed, "angular speed", {0, 0, -1, 1}, "deg/s, rad/s", "1 deg/s"},
    {Dimension::acceleration, "acceleration", {1, 0, -2, 0}, "m/s^2, mm/s^2", "9.81 m/s^2"},
    {Dimension::damping, "damping", {0, 1, -1, 0}, "N s/m, N s/mm, kg/s", "1 N s/mm"},
    {Dimension::angularDamping, "rotational damping", {2, 1, -1, -1}, "N m s/rad, N m s/deg, N m s", "0.1 N m s/rad"},
    {Dimension::inverseSpeed, "inverse speed", {-1, 0, 1, 0}, "s/m, s/mm", "0.5 s/m"},
    {Dimension::inverseAngularSpeed, "inverse angular speed", {0, 0, 1, -1}, "s/rad, s/deg", "0.1 s/rad"},
    {Dimension::stiffness, "stiffness", {0, 1, -2, 0}, "N/mm, N/m, kN/m", "100 N/mm"},
    {Dimension::angularStiffness, "rotational stiffness", {2, 1, -2, -1}, "N m/rad, N m/deg", "10 N m/rad"},
    {Dimension::inverseLength, "inverse length", {-1, 0, 0, 0}, "1/mm, 1/m", "0.1 1/mm"},
    {Dimension::inverseAngle, "inverse angle", {0, 0, 0, -1}, "1/deg, 1/rad", "0.05 1/deg"},
    {Dimension::frequency, "rate", {0, 0, -1, 0}, "1/s", "10 1/s"},
}};

const DimensionInfo& infoOf(Dimension dimension) {
  return *std::find_if(kDimensions.begin(), kDimensions.end(),
                       [dimension](const DimensionInfo& info) { return info.dimension == dimension; });
}

bool isSpace(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

std::string trim(const std::string& text) {
  size_t begin = 0, end = text.size();
  while (begin < end && isSpace(text[begin])) ++begin;
  while (end > begin && isSpace(text[end - 1])) --end;
  return text.substr(begin, end - begin);
}

std::string quote(const std::string& text) {
  return "\"" + (text.size() > 80 ? text.substr(0, 80) + "..." : text) + "\"";
}

std::string withArticle(const std::string& noun) {
  const bool vowel = noun.find_first_of("aeiou") == 0;
  return (vowel ? "an " : "a ") + noun;
}

std::string usage(Dimension dimension) {
  const DimensionInfo& info = infoOf(dimension);
  if (dimension == Dimension::dimensionless) return "allowed: a number without a unit, for example 0.46, or %";
  return std::string("units accepted: ") + info.accepted + "; for example \"" + info.example + "\"";
}

[[noreturn]] void fail(const std::string& where, const std::string& what) {
  throw InputError(where.empty() ? what : where + ": " + what);
}

/** "N s/mm" = N s / mm. A product after a quotient ("N/mm s") is refused, because readers disagree on it. */
/** "Ns" to "N s": units written without the blank between them; empty when it is no such product. Longest names first. */
std::string splitProduct(const std::string& text, const std::vector<std::string>& names) {
  for (size_t length = text.size() - (text.empty() ? 0 : 1); length > 0; --length) {
    const std::string head = text.substr(0, length), tail = text.substr(length);
    if (std::find(names.begin(), names.end(), head) == names.end()) continue;
    if (std::find(names.begin(), names.end(), tail) != names.end()) return head + " " + tail;
    const std::string rest = splitProduct(tail, names);
    if (!rest.empty()) return head + " " + rest;
  }
  return {};
}

std::optional<Unit> parseUnitExpression(const std::string& text, std::string& problem) {
  Unit result;
  size_t i = 0;
  bool divide = false, divided = false, needFactor = true;
  const auto startsWith = [&text, &i](const char* s) {
    return text.compare(i, std::char_traits<char>::length(s), s) == 0;
  };
  while (true) {
    bool separator = false;
    while (i < text.size()) {
      if (isSpace(text[i])) {
        ++i;
        separator = true;
      } else if (text[i] == '*' && !needFactor) {
        ++i;
        separator = needFactor = true;
      } else if (startsWith("\u00b7") && !needFactor) {
        i += 2;
        separator = needFactor = true;
      } else if (text[i] == '/' && !needFactor) {
        ++i;
        divide = divided = separator = needFactor = true;
      } else {
        break;
      }
    }
    if (i >= text.size()) break;
    if (!needFactor && !separator) {
      problem = "cannot read the unit " + quote(text);
      return std::nullopt;
    }
    if (divided && !divide) {
      problem = "the unit " + quote(text) + " is ambiguous: write products before the quotient, as in \"N s/mm\"";
      return std::nullopt;
    }
    size_t end = i;
    while (end < text.size() && !isSpace(text[end]) && text[end] != '*' && text[end] != '/' && text[end] != '^' &&
           text.compare(end, 2, "\u00b7") != 0 && text.compare(end, 2, "\u00b2") != 0 &&
           text.compare(end, 2, "\u00b3") != 0) {
      ++end;
    }
    const std::string symbol = text.substr(i, end - i);
    const auto* found =
        std::find_if(kSymbols.begin(), kSymbols.end(), [&symbol](const Symbol& s) { return symbol == s.name; });
    if (found == kSymbols.end()) {
      std::vector<std::string> names;
      for (const Symbol& s : kSymbols) names.push_back(s.name);
      const std::string split = splitProduct(symbol, names);
      const std::string nearest = !split.empty() ? split : symbol.size() > 1 ? findNearest(symbol, names) : std::string();
      problem = "unknown unit " + quote(symbol.empty() ? text : symbol);
      if (!nearest.empty()) problem += " (did you mean \"" + nearest + "\"?)";
      return std::nullopt;
    }
    i = end;
    int power = 1;
    if (text.compare(i, 2, "\u00b2") == 0 || text.compare(i, 2, "\u00b3") == 0) {
      power = text.compare(i, 2, "\u00b2") == 0 ? 2 : 3;
      i += 2;
    } else if (i < text.size() && text[i] == '^') {
      const char* begin = text.data() + i + 1;
      const auto [rest, error] = std::from_chars(begin, text.data() + text.size(), power);
      if (error != std::errc() || power == 0 || power < -9 || power > 9) {
        problem = "cannot read the power in the unit " + quote(text) + " (allowed: -9 to 9)";
        return std::nullopt;
      }
      i = static_cast<size_t>(rest - text.data());
    }
    if (divide) power = -power;
    for (int n = 0; n < std::abs(power); ++n) {
      result.si = power > 0 ? result.si * found->unit.si : result.si / found->unit.si;
    }
    for (size_t k = 0; k < result.powers.size(); ++k) result.powers[k] += power * found->unit.powers[k];
    divide = needFactor = false;
  }
  if (needFactor) {
    problem = text.empty() ? "the unit is missing" : "the unit " + quote(text) + " ends with an operator";
    return std::nullopt;
  }
  return result;
}

bool hasDimension(const Powers& powers, Dimension dimension) {
  Powers wanted = infoOf(dimension).powers;
  if (powers == wanted) return true;
  if (dimension != Dimension::angularDamping) return false;
  wanted[3] = 0;  // N m s: the radian is often left out
  return powers == wanted;
}

/** Names the dimension of a unit, "a length", or writes its powers. */
std::string describe(const Powers& powers) {
  for (const DimensionInfo& info : kDimensions) {
    if (info.powers == powers) return withArticle(info.name);
  }
  std::string text;
  constexpr std::array<const char*, 4> bases = {"m", "kg", "s", "rad"};
  for (size_t k = 0; k < bases.size(); ++k) {
    if (powers[k] != 0) text += (text.empty() ? "" : " ") + std::string(bases[k]) + "^" + std::to_string(powers[k]);
  }
  return text;
}

struct NumberAndRest {
  double value;
  std::string rest;
};

NumberAndRest splitNumber(const std::string& text, bool allowInfinity, const std::string& expected,
                          const std::string& where) {
  const std::string body = trim(text);
  const char *begin = body.data(), *end = begin + body.size();
  if (begin != end && *begin == '+' && end - begin > 1 && begin[1] != '-' && begin[1] != '+') ++begin;
  // YAML writes infinity as .inf
  const bool negative = begin != end && *begin == '-';
  const char* word = begin + (negative ? 1 : 0);
  std::string lower(word, end);
  std::transform(lower.begin(), lower.end(), lower.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (!lower.empty() && lower[0] == '.' && (lower.rfind(".inf", 0) == 0 || lower.rfind(".nan", 0) == 0))
    lower.erase(0, 1), ++word;
  if (lower.rfind("nan", 0) == 0) fail(where, quote(body) + " is not a number; " + expected);
  if (lower.rfind("inf", 0) == 0) {
    if (!allowInfinity) fail(where, quote(body) + " is infinite, a finite value is needed; " + expected);
    const size_t length = lower.rfind("infinity", 0) == 0 ? 8 : 3;
    const double infinity = std::numeric_limits<double>::infinity();
    return {negative ? -infinity : infinity, trim(std::string(word + length, end))};
  }
  double value = 0;
  const auto [rest, error] = std::from_chars(begin, end, value);
  if (error == std::errc::result_out_of_range)
    fail(where, quote(body) + " is beyond what a number can hold; " + expected);
  if (error != std::errc()) {
    fail(where, (body.empty() ? std::string("a value is missing") : quote(body) + " does not begin with a number") +
                    "; " + expected);
  }
  return {value, trim(std::string(rest, end))};
}

double parseQuantityGeneral(const std::string& text, Dimension dimension, bool allowInfinity,
                            const std::string& where) {
  const std::string expected = usage(dimension);
  const NumberAndRest parts = splitNumber(text, allowInfinity, expected, where);
  if (parts.rest.empty()) {
    if (dimension == Dimension::dimensionless || std::isinf(parts.value)) return parts.value;
    fail(where, quote(trim(text)) + " has no unit, " + withArticle(infoOf(dimension).name) + " needs one; " + expected);
  }
  std::string problem;
  const std::optional<Unit> unit = parseUnitExpression(parts.rest, problem);
  if (!unit) fail(where, quote(trim(text)) + ": " + problem + "; " + expected);
  if (!hasDimension(unit->powers, dimension)) {
    fail(where, quote(trim(text)) + " is " + describe(unit->powers) + ", " + withArticle(infoOf(dimension).name) +
                    " is needed; " + expected);
  }
  // A quotient by the inverse is exact where the inverse is an integer: 8 mm = 8 / 1000 is the double nearest to 0.008.
  const double inverse = 1 / unit->si;
  const double value = unit->si < 1 && inverse == std::round(inverse) ? parts.value / inverse : parts.value * unit->si;
  if (std::isinf(value) && !std::isinf(parts.value)) {
    fail(where, quote(trim(text)) + " is beyond what a number can hold; " + expected);
  }
  return value;
}

}  // namespace

const char* toString(Dimension dimension) { return infoOf(dimension).name; }

const char* acceptedUnits(Dimension dimension) { return infoOf(dimension).accepted; }

double parseNumber(const std::string& text, const std::string& where) {
  const std::string expected = "a plain number is needed, for example 0.46";
  const NumberAndRest parts = splitNumber(text, false, expected, where);
  if (!parts.rest.empty()) fail(where, quote(trim(text)) + " is not a plain number; " + expected);
  return parts.value;
}

double parseQuantity(const std::string& text, Dimension dimension, const std::string& where) {
  return parseQuantityGeneral(text, dimension, false, where);
}

double parseQuantityOrInfinity(const std::string& text, Dimension dimension, const std::string& where) {
  return parseQuantityGeneral(text, dimension, true, where);
}

double parseUnit(const std::string& unit, Dimension dimension, const std::string& where) {
  std::string problem;
  const std::optional<Unit> parsed = parseUnitExpression(trim(unit), problem);
  if (!parsed) fail(where, problem + "; units accepted: " + acceptedUnits(dimension));
  if (!hasDimension(parsed->powers, dimension)) {
    fail(where, quote(trim(unit)) + " is the unit of " + describe(parsed->powers) + ", " +
                    withArticle(infoOf(dimension).name) + " is needed; units accepted: " + acceptedUnits(dimension));
  }
  return parsed->si;
}

double parseScaledUnit(const std::string& scale, const std::string& unit, Dimension dimension,
                       const std::string& where) {
  const NumberAndRest parts = splitNumber(scale, false, "a number, with a unit if the column has none", where);
  std::string problem;
  const std::optional<Unit> column = parseUnitExpression(trim(unit), problem);
  if (!column) fail(where, "unit: " + problem + "; units accepted: " + acceptedUnits(dimension));
  std::optional<Unit> factor = Unit{};
  if (!parts.rest.empty()) factor = parseUnitExpression(parts.rest, problem);
  if (!factor) fail(where, "scale: " + problem);
  Powers powers = column->powers;
  for (size_t k = 0; k < powers.size(); ++k) powers[k] += factor->powers[k];
  if (!hasDimension(powers, dimension)) {
    fail(where, "scale " + quote(trim(scale)) + " times unit " + quote(trim(unit)) + " is " + describe(powers) + ", " +
                    withArticle(infoOf(dimension).name) + " is needed; " + usage(dimension));
  }
  const double result = parts.value * factor->si * column->si;
  if (!std::isfinite(result)) fail(where, "scale " + quote(trim(scale)) + " is beyond what a number can hold");
  return result;
}

std::string formatQuantity(double si, const std::string& unit, int digits) {
  std::string problem;
  const std::optional<Unit> parsed = parseUnitExpression(trim(unit), problem);
  if (!parsed) throw std::invalid_argument(problem);
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.*g", digits, si / parsed->si);
  return std::string(buffer.data()) + " " + trim(unit);
}

std::string formatNumber(double value) {
  std::array<char, 32> buffer{};
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value);
  return error == std::errc() ? std::string(buffer.data(), end) : std::string("nan");
}

std::vector<std::string> splitList(const std::string& text) {
  std::vector<std::string> parts;
  size_t begin = 0;
  while (true) {
    const size_t comma = text.find(',', begin);
    parts.push_back(trim(text.substr(begin, comma == std::string::npos ? comma : comma - begin)));
    if (comma == std::string::npos) return parts;
    begin = comma + 1;
  }
}

}  // namespace genu::io
