#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "genu/scene/Errors.h"

namespace genu::io {

/** Numbers in named columns, as written in the file (no unit conversion). Formats: docs/file_formats.md. */
struct Table {
  std::vector<std::string> columns;
  std::vector<std::vector<double>> data;  ///< [column][row]
  bool inDegrees = false;                 ///< `inDegrees=yes` in the header of a .sto or .mot
  std::string name;                       ///< first header line of a .sto or .mot; empty for .csv
  std::filesystem::path file;
  std::vector<int> lines;  ///< line of each row in the file; empty for a table that was not read

  int numRows() const { return data.empty() ? 0 : static_cast<int>(data.front().size()); }
  int numColumns() const { return static_cast<int>(columns.size()); }
  /** Index or -1. */
  int findColumn(const std::string& column) const;
  /** @throws InputError with the columns there are and the nearest one */
  int getColumn(const std::string& column, const std::string& where) const;
};

/** Reads .csv (comma, semicolon or tab; first row: names; lines that begin with # and empty lines are skipped), .sto
 and .mot (OpenSim: header up to `endheader`, names, numbers).
 @throws InputError with file, line and column: missing file, unknown extension, no row, a repeated or empty name, a row
 of another length, text where a number is needed, NaN, infinity, a column `time` that does not increase */
Table readTable(const std::filesystem::path& path);

/** The same, but only the named columns need to be numbers (a table may have columns of text or gaps elsewhere); only
 these are returned, in the order asked. `where` names who asks: "scene.yaml:12: ...".
 @throws InputError also when a column is missing, with the nearest name */
Table readTable(const std::filesystem::path& path, const std::vector<std::string>& columns, const std::string& where);

/** The same from text in memory; `path` gives the format (its extension) and the name in messages. */
Table parseTable(const std::string& text, const std::filesystem::path& path);

/** @throws InputError with file, line and column unless the values increase strictly */
void requireIncreasing(const Table& table, int column);

/** OpenSim storage text: shortest round-trip numbers, tab separated. Written beside the target and renamed, so that a
 reader never sees half a file. Comment lines go into the header.
 @throws ComputationError when it cannot be written; std::invalid_argument when the table is ragged or its first column
 is not `time` */
void writeSto(const std::filesystem::path& path, const std::string& name, const Table& table, bool inDegrees,
              const std::string& headerComment = {});

}  // namespace genu::io
