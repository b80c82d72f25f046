#pragma once

#include <string>

namespace genu::fuzz {

/** Each reads `text` as one kind of input. InputError is the answer to wrong input and is swallowed; any other
 exception, crash or sanitizer report is a defect. */
void readSceneText(const std::string& text);
void readCsvText(const std::string& text);
void readStoText(const std::string& text);
void readNurbsText(const std::string& text);
void readUnitsText(const std::string& text);

}  // namespace genu::fuzz
