#pragma once

#include <string>
#include <vector>

#include "genu/scene/Errors.h"

namespace genu::io {

/** Kinds of quantity in user files; the value in the program is SI.

   dimension      SI            common units in files
   dimensionless  1             bare number, %
   length         m             mm, cm, m, um
   angle          rad           deg, rad
   time           s             s, ms, min
   mass           kg            kg, g, t
   force          N             N, kN
   moment         N m           N m, N mm, Nm, kN m
   pressure       Pa            MPa, kPa, Pa, GPa, N/mm^2
   speed          m/s           m/s, mm/s
   acceleration   m/s^2         m/s^2, mm/s^2
   damping        N s/m         N s/m, N s/mm, kg/s
   angularDamping N m s/rad     N m s/rad, N m s/deg, N m s
   inverseSpeed   s/m           s/m, s/mm
   inverseAngularSpeed  s/rad   s/rad, s/deg
   stiffness      N/m           N/mm, N/m, kN/m
   angularStiffness  N m/rad    N m/rad, N m/deg
   inverseLength  1/m           1/mm, 1/m
   inverseAngle   1/rad         1/deg, 1/rad
   frequency      1/s           1/s

 A unit is any product of m, g, t, s, min, N, Pa, J, rad, deg, % (the usual prefixes u, m, c, k, M, G where they make
 sense) with integer powers: "N s/mm", "N*m", "kg m^2/s^2". What counts is its dimension. */
enum class Dimension {
  dimensionless,
  length,
  angle,
  time,
  mass,
  force,
  moment,
  pressure,
  speed,
  angularSpeed,
  acceleration,
  damping,
  angularDamping,
  inverseSpeed,
  inverseAngularSpeed,
  stiffness,
  angularStiffness,
  inverseLength,
  inverseAngle,
  frequency
};

/** "length", "force", ... */
const char* toString(Dimension dimension);

/** The units to name in a message: "mm, cm, m, um". */
const char* acceptedUnits(Dimension dimension);

/** A finite number and nothing else, "1e-4", " -3 ". Independent of the locale.
 @throws InputError `where: ...` */
double parseNumber(const std::string& text, const std::string& where);

/** A number followed by a unit of the asked dimension, "463 MPa" or "8mm", in SI. Dimensionless: a bare number or %.
 `where` names the place, "scene.yaml:4: materials.insert.E", and begins every message.
 @throws InputError no number, no unit (bare number, 0 included), unknown unit, wrong dimension, NaN, infinity */
double parseQuantity(const std::string& text, Dimension dimension, const std::string& where);

/** Like parseQuantity, and "inf", "-inf" (also with a unit) give infinity. */
double parseQuantityOrInfinity(const std::string& text, Dimension dimension, const std::string& where);

/** SI value of one unit, 1e-3 for "mm". @throws InputError unknown unit or wrong dimension */
double parseUnit(const std::string& unit, Dimension dimension, const std::string& where);

/** A number whose unit may be any whose product with `unit` has the asked dimension: "686 N" scales a column in body
 weights (unit 1) to a force. Returns scale x unit in SI. */
double parseScaledUnit(const std::string& scale, const std::string& unit, Dimension dimension,
                       const std::string& where);

/** "463 MPa": `si` in the given unit with up to `digits` significant digits.
 @throws std::invalid_argument when the unit is not known */
std::string formatQuantity(double si, const std::string& unit, int digits = 6);

/** Shortest text that reads back as the same double. */
std::string formatNumber(double value);

/** Splits "a, b, c" at commas and trims. */
std::vector<std::string> splitList(const std::string& text);

}  // namespace genu::io
