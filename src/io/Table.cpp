#include "genu/io/Table.h"

#include <csv.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "genu/io/Files.h"
#include "genu/io/Suggest.h"
#include "genu/io/Units.h"

namespace genu::io {

namespace {

namespace fs = std::filesystem;

/** A file cut into cells; numbers are made later, for the columns that need them. */
struct RawTable {
  std::string name;
  bool inDegrees = false;
  int headerLine = 0;
  std::vector<std::string> columns;
  std::vector<std::vector<std::string>> rows;
  std::vector<int> lines;
};

std::string place(const fs::path& file, int line) { return file.string() + ":" + std::to_string(line); }

std::string trim(const std::string& text) {
  const char* blank = " \t\r\n";
  const size_t begin = text.find_first_not_of(blank);
  if (begin == std::string::npos) return {};
  return text.substr(begin, text.find_last_not_of(blank) - begin + 1);
}

std::string toLower(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

std::vector<std::string> splitLines(const std::string& text) {
  std::vector<std::string> lines;
  size_t begin = text.compare(0, 3, "\xef\xbb\xbf") == 0 ? 3 : 0;  // a byte order mark is no letter of the first name
  while (begin < text.size()) {
    // A line ends with \n, \r\n or a lone \r (old spreadsheets).
    size_t end = text.find_first_of("\r\n", begin);
    if (end == std::string::npos) end = text.size();
    lines.push_back(text.substr(begin, end - begin));
    begin = end + (text.compare(end, 2, "\r\n") == 0 ? 2 : 1);
  }
  return lines;
}

void checkColumns(const RawTable& raw, const fs::path& file) {
  std::map<std::string, size_t> seen;
  for (size_t c = 0; c < raw.columns.size(); ++c) {
    const std::string at = place(file, raw.headerLine) + ": column " + std::to_string(c + 1);
    if (raw.columns[c].empty()) throw InputError(at + " has no name; the first row must name every column");
    const auto [first, inserted] = seen.emplace(raw.columns[c], c);
    if (!inserted) {
      throw InputError(at + " repeats the name \"" + raw.columns[c] + "\" of column " +
                       std::to_string(first->second + 1) + "; names must differ");
    }
  }
}

void addRow(RawTable& raw, std::vector<std::string> cells, int line, const fs::path& file) {
  if (cells.size() != raw.columns.size()) {
    throw InputError(place(file, line) + ": " + std::to_string(cells.size()) + " values where line " +
                     std::to_string(raw.headerLine) + " names " + std::to_string(raw.columns.size()) +
                     " columns; every row needs one value per column");
  }
  raw.rows.push_back(std::move(cells));
  raw.lines.push_back(line);
}

/** State of the CSV reader's callbacks; they are called from C, so nothing may be thrown there. */
struct CsvRows {
  std::vector<std::string> cells;
  std::vector<std::vector<std::string>> finished;
};

extern "C" void onCsvCell(void* cell, size_t length, void* rows) {
  static_cast<CsvRows*>(rows)->cells.emplace_back(static_cast<const char*>(cell), length);
}

extern "C" void onCsvRow(int, void* data) {
  auto* rows = static_cast<CsvRows*>(data);
  rows->finished.push_back(std::move(rows->cells));
  rows->cells.clear();
}

RawTable parseCsv(const std::string& text, const fs::path& file) {
  RawTable raw;
  struct Parser : csv_parser {
    Parser() { csv_init(this, CSV_STRICT | CSV_STRICT_FINI); }
    Parser(const Parser&) = delete;
    Parser& operator=(const Parser&) = delete;
    ~Parser() { csv_free(this); }
  } parser;
  CsvRows rows;
  int line = 0, rowLine = 0;
  bool haveDelimiter = false, insideRow = false;
  const auto takeRows = [&]() {
    for (std::vector<std::string>& cells : rows.finished) {
      for (std::string& cell : cells) cell = trim(cell);
      if (raw.columns.empty()) {
        raw.columns = std::move(cells);
        raw.headerLine = rowLine;
        checkColumns(raw, file);
      } else {
        addRow(raw, std::move(cells), rowLine, file);
      }
      insideRow = false;
    }
    rows.finished.clear();
  };
  // Fed line by line, so that a row knows its line even after quoted line breaks, comments and empty lines.
  for (const std::string& content : splitLines(text)) {
    ++line;
    if (!insideRow) {
      const std::string trimmed = trim(content);
      if (trimmed.empty() || trimmed[0] == '#') continue;
      rowLine = line;
    }
    if (!haveDelimiter) {
      haveDelimiter = true;
      for (const char candidate : {',', ';', '\t'}) {
        if (content.find(candidate) == std::string::npos) continue;
        csv_set_delim(&parser, static_cast<unsigned char>(candidate));
        break;
      }
    }
    insideRow = true;
    const std::string fed = content + "\n";
    if (csv_parse(&parser, fed.data(), fed.size(), onCsvCell, onCsvRow, &rows) != fed.size()) {
      throw InputError(place(file, line) + ": not valid CSV (" + csv_strerror(csv_error(&parser)) +
                       "); quotes must enclose a whole value, \"like this\"");
    }
    takeRows();
  }
  if (csv_fini(&parser, onCsvCell, onCsvRow, &rows) != 0) {
    throw InputError(place(file, rowLine) + ": a quoted value that begins in this row is never closed");
  }
  takeRows();
  return raw;
}

std::vector<std::string> splitSto(const std::string& line) {
  std::vector<std::string> cells;
  if (line.find('\t') != std::string::npos) {
    size_t begin = 0;
    while (begin <= line.size()) {
      const size_t end = std::min(line.find('\t', begin), line.size());
      cells.push_back(trim(line.substr(begin, end - begin)));
      begin = end + 1;
    }
    // OpenSim ends lines with a tab.
    while (!cells.empty() && cells.back().empty()) cells.pop_back();
    while (!cells.empty() && cells.front().empty()) cells.erase(cells.begin());
    return cells;
  }
  size_t begin = 0;
  while ((begin = line.find_first_not_of(' ', begin)) != std::string::npos) {
    const size_t end = std::min(line.find(' ', begin), line.size());
    cells.push_back(line.substr(begin, end - begin));
    begin = end;
  }
  return cells;
}

RawTable parseSto(const std::string& text, const fs::path& file) {
  RawTable raw;
  const std::vector<std::string> lines = splitLines(text);
  size_t i = 0;
  int declaredRows = -1, declaredColumns = -1, rowsLine = 0, columnsLine = 0;
  const auto readCount = [&file](const std::string& value, int line, const std::string& key) {
    int count = -1;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), count);
    if (error != std::errc() || end != value.data() + value.size() || count < 0) {
      throw InputError(place(file, line) + ": " + key + "=" + value + " is not a count");
    }
    return count;
  };
  bool ended = false;
  for (; i < lines.size() && !ended; ++i) {
    const std::string line = trim(lines[i]);
    const int number = static_cast<int>(i) + 1;
    if (toLower(line) == "endheader") {
      ended = true;
      continue;
    }
    const size_t equals = line.find('=');
    const std::string key = toLower(trim(line.substr(0, equals)));
    const std::string value = equals == std::string::npos ? std::string() : trim(line.substr(equals + 1));
    if (i == 0 && equals == std::string::npos) raw.name = line;
    // The older .mot header separates by a space: "datarows 101".
    if (key == "nrows") {
      declaredRows = readCount(value, number, key);
      rowsLine = number;
    } else if (key == "ncolumns") {
      declaredColumns = readCount(value, number, key);
      columnsLine = number;
    } else if (key == "indegrees") {
      const std::string answer = toLower(value);
      if (answer != "yes" && answer != "no") {
        throw InputError(place(file, number) + ": inDegrees=" + value + "; allowed: yes, no");
      }
      raw.inDegrees = answer == "yes";
    }
  }
  if (!ended) {
    throw InputError(file.string() + ": no line \"endheader\"; a .sto or .mot file has a header that ends with it");
  }
  for (; i < lines.size(); ++i) {
    std::vector<std::string> cells = splitSto(lines[i]);
    if (cells.empty()) continue;
    const int number = static_cast<int>(i) + 1;
    if (raw.columns.empty()) {
      raw.columns = std::move(cells);
      raw.headerLine = number;
      checkColumns(raw, file);
      if (toLower(raw.columns[0]) != "time") {
        throw InputError(place(file, number) + ": the first column is \"" + raw.columns[0] +
                         "\"; in a .sto or .mot file it must be \"time\"");
      }
      raw.columns[0] = "time";
    } else {
      addRow(raw, std::move(cells), number, file);
    }
  }
  if (declaredRows >= 0 && declaredRows != static_cast<int>(raw.rows.size())) {
    throw InputError(place(file, rowsLine) + ": nRows=" + std::to_string(declaredRows) + ", but the file has " +
                     std::to_string(raw.rows.size()) + " rows; is it cut off?");
  }
  if (declaredColumns >= 0 && declaredColumns != static_cast<int>(raw.columns.size())) {
    throw InputError(place(file, columnsLine) + ": nColumns=" + std::to_string(declaredColumns) +
                     ", but the file has " + std::to_string(raw.columns.size()) + " columns");
  }
  return raw;
}

RawTable parseRaw(const std::string& text, const fs::path& file) {
  const std::string extension = toLower(file.extension().string());
  RawTable raw;
  if (extension == ".csv") {
    raw = parseCsv(text, file);
  } else if (extension == ".sto" || extension == ".mot") {
    raw = parseSto(text, file);
  } else {
    throw InputError("table \"" + file.string() + "\": unknown extension \"" + extension +
                     "\"; allowed: .csv, .sto, .mot");
  }
  if (raw.columns.empty())
    throw InputError(file.string() + ": the table is empty; a row of names and a row of numbers are needed");
  if (raw.rows.empty()) throw InputError(place(file, raw.headerLine) + ": the table has names but no row of numbers");
  return raw;
}

double parseCell(const RawTable& raw, size_t row, size_t column, const fs::path& file) {
  const std::string& text = raw.rows[row][column];
  const std::string at =
      place(file, raw.lines[row]) + ": column \"" + raw.columns[column] + "\" (" + std::to_string(column + 1) + ")";
  if (text.empty()) throw InputError(at + " is empty; a number is needed");
  const std::string lower = toLower(text);
  if (lower == "nan" || lower == "-nan" || lower == "na" || lower == "n/a") {
    throw InputError(at + " is " + text + "; a number is needed: remove the row or fill the gap");
  }
  return parseNumber(text, at);
}

Table convert(const RawTable& raw, const std::vector<size_t>& columns, const fs::path& file) {
  Table table;
  table.name = raw.name;
  table.inDegrees = raw.inDegrees;
  table.file = file;
  table.lines = raw.lines;
  for (const size_t column : columns) {
    table.columns.push_back(raw.columns[column]);
    table.data.emplace_back();
    table.data.back().reserve(raw.rows.size());
  }
  // Row by row, so that the first error in the file is the one reported.
  for (size_t row = 0; row < raw.rows.size(); ++row) {
    for (size_t k = 0; k < columns.size(); ++k) table.data[k].push_back(parseCell(raw, row, columns[k], file));
  }
  const int time = table.findColumn("time");
  if (time >= 0) requireIncreasing(table, time);
  return table;
}

int findName(const std::vector<std::string>& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : static_cast<int>(found - names.begin());
}

[[noreturn]] void throwNoColumn(const std::string& where, const std::string& column, const fs::path& file,
                                const std::vector<std::string>& columns) {
  const std::string prefix = where.empty() ? std::string() : where + ": ";
  throw InputError(prefix + file.string() + ": " + describeUnknown("column", column, columns));
}

}  // namespace

int Table::findColumn(const std::string& column) const { return findName(columns, column); }

int Table::getColumn(const std::string& column, const std::string& where) const {
  const int found = findColumn(column);
  if (found < 0) throwNoColumn(where, column, file, columns);
  return found;
}

void requireIncreasing(const Table& table, int column) {
  const std::vector<double>& values = table.data.at(static_cast<size_t>(column));
  for (size_t row = 1; row < values.size(); ++row) {
    if (values[row] > values[row - 1]) continue;
    const int line = row < table.lines.size() ? table.lines[row] : static_cast<int>(row) + 1;
    throw InputError(place(table.file, line) + ": column \"" + table.columns[static_cast<size_t>(column)] + "\" is " +
                     formatNumber(values[row]) + " after " + formatNumber(values[row - 1]) +
                     "; it must increase from row to row");
  }
}

Table parseTable(const std::string& text, const fs::path& path) {
  const RawTable raw = parseRaw(text, path);
  std::vector<size_t> columns;
  for (size_t c = 0; c < raw.columns.size(); ++c) columns.push_back(c);
  return convert(raw, columns, path);
}

Table readTable(const fs::path& path) { return parseTable(readFile(path), path); }

Table readTable(const fs::path& path, const std::vector<std::string>& names, const std::string& where) {
  try {
    const RawTable raw = parseRaw(readFile(path), path);
    std::vector<size_t> columns;
    for (const std::string& name : names) {
      const int found = findName(raw.columns, name);
      if (found < 0) throwNoColumn({}, name, path, raw.columns);
      columns.push_back(static_cast<size_t>(found));
    }
    return convert(raw, columns, path);
  } catch (const InputError& error) {
    if (where.empty()) throw;
    throw InputError(where + ": " + error.what());
  }
}

void writeSto(const fs::path& path, const std::string& name, const Table& table, bool inDegrees,
              const std::string& headerComment) {
  if (table.columns.empty() || table.columns.front() != "time") {
    throw std::invalid_argument("writeSto: the first column must be \"time\"");
  }
  if (table.data.size() != table.columns.size())
    throw std::invalid_argument("writeSto: as many columns as names needed");
  for (const std::vector<double>& column : table.data) {
    if (column.size() != table.data.front().size()) throw std::invalid_argument("writeSto: columns differ in length");
  }
  std::string text = name + "\nversion=1\nnRows=" + std::to_string(table.numRows()) +
                     "\nnColumns=" + std::to_string(table.numColumns()) + "\ninDegrees=" + (inDegrees ? "yes" : "no") +
                     "\n";
  for (const std::string& line : splitLines(headerComment)) {
    if (!trim(line).empty()) text += line + "\n";
  }
  text += "endheader\n";
  for (size_t c = 0; c < table.columns.size(); ++c) text += (c == 0 ? "" : "\t") + table.columns[c];
  text += "\n";
  for (size_t row = 0; row < table.data.front().size(); ++row) {
    for (size_t c = 0; c < table.data.size(); ++c) text += (c == 0 ? "" : "\t") + formatNumber(table.data[c][row]);
    text += "\n";
  }
  writeFileAtomically(path, text);
}

}  // namespace genu::io
