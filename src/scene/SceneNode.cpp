#include "genu/scene/SceneNode.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <sstream>

#include "genu/io/Suggest.h"

namespace genu::scene {

namespace {

std::string shorten(const std::string& text) { return text.size() > 80 ? text.substr(0, 80) + "..." : text; }

int lineOf(const YAML::Node& node, int fallback) {
  const YAML::Mark mark = node.Mark();
  return mark.line >= 0 ? mark.line + 1 : fallback;
}

/** Notes where documents begin. */
class DocumentCounter : public YAML::EventHandler {
 public:
  std::vector<int> lines;

  void OnDocumentStart(const YAML::Mark& mark) override { lines.push_back(mark.line + 1); }
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark&, YAML::anchor_t) override {}
  void OnAlias(const YAML::Mark&, YAML::anchor_t) override {}
  void OnScalar(const YAML::Mark&, const std::string&, YAML::anchor_t, const std::string&) override {}
  void OnSequenceStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnSequenceEnd() override {}
  void OnMapStart(const YAML::Mark&, const std::string&, YAML::anchor_t, YAML::EmitterStyle::value) override {}
  void OnMapEnd() override {}
};

}  // namespace

SceneNode::SceneNode(const YAML::Node& node, std::string path, int line, SceneDocument& document)
    : node_(std::make_shared<const YAML::Node>(node)), path_(std::move(path)), line_(line), document_(&document) {}

bool SceneNode::isMap() const { return node_->IsMap(); }
bool SceneNode::isScalar() const { return node_->IsScalar(); }
bool SceneNode::isSequence() const { return node_->IsSequence(); }

SceneNode SceneNode::parse(const std::string& text, SceneDocument& document) {
  YAML::Node root;
  DocumentCounter counter;
  try {
    root = YAML::Load(text);
    // Load() stops silently at the end of the first document. Two steps tell whether more follows; LoadAll() is no
    // choice, since it never ends on some texts (a leading comma).
    std::istringstream stream(text);
    YAML::Parser parser(stream);
    parser.HandleNextDocument(counter);
    parser.HandleNextDocument(counter);
  } catch (const YAML::Exception& error) {
    const int line = error.mark.line >= 0 ? error.mark.line + 1 : 1;
    throw InputError(document.file + ":" + std::to_string(line) + ": not valid YAML: " + error.msg + " (column " +
                     std::to_string(std::max(error.mark.column, 0) + 1) +
                     "); often a wrong indentation, a missing colon or an unclosed quote or bracket");
  }
  if (!root.IsDefined() || root.IsNull()) {
    throw InputError(document.file + ":1: the scene is empty; its first line must be \"genu: 1\"");
  }
  if (counter.lines.size() > 1) {
    throw InputError(
        document.file + ":" + std::to_string(counter.lines[1]) +
        ": a second YAML document begins here (\"---\"), or the first has ended early; a scene is one document");
  }
  const int line = lineOf(root, 1);
  return {root, "", line, document};
}

std::string SceneNode::where() const {
  return document_->file + ":" + std::to_string(line_) + (path_.empty() ? "" : ": " + path_);
}

void SceneNode::fail(const std::string& what) const { throw InputError(where() + ": " + what); }

std::string SceneNode::describe() const {
  if (node_->IsMap()) return "is a mapping";
  if (node_->IsSequence()) return "is a list";
  if (!node_->IsScalar()) return "is empty";
  return node_->Scalar().empty() ? "is empty" : "is \"" + shorten(node_->Scalar()) + "\"";
}

std::vector<std::pair<std::string, SceneNode>> SceneNode::items() const {
  if (!node_->IsMap()) fail(describe() + ", keys with values are needed");
  std::vector<std::pair<std::string, SceneNode>> result;
  std::map<std::string, int> seen;
  for (const auto& item : *node_) {
    const int line = lineOf(item.first, line_);
    if (!item.first.IsScalar() || item.first.Scalar().empty()) {
      throw InputError(document_->file + ":" + std::to_string(line) + (path_.empty() ? "" : ": " + path_) +
                       ": a key is empty or not a text");
    }
    const std::string key = item.first.Scalar();
    const auto [first, inserted] = seen.emplace(key, line);
    if (!inserted) {
      throw InputError(document_->file + ":" + std::to_string(line) + ": " + shorten(childPath(key)) +
                       ": this key was given before, in line " + std::to_string(first->second));
    }
    document_->keyLines[childPath(key)] = line;
    result.emplace_back(key, SceneNode(item.second, childPath(key), line, *document_));
  }
  return result;
}

void SceneNode::requireKeys(const std::vector<std::string>& allowed) const {
  for (const auto& [key, value] : items()) {
    if (std::find(allowed.begin(), allowed.end(), key) == allowed.end()) {
      throw InputError(document_->file + ":" + std::to_string(value.line()) + ": " + shorten(value.path()) + ": " +
                       io::describeUnknown("key", key, allowed));
    }
  }
}

std::optional<SceneNode> SceneNode::find(const std::string& key) const {
  for (auto& [name, value] : items()) {
    if (name == key) return value;
  }
  return std::nullopt;
}

SceneNode SceneNode::get(const std::string& key, const std::string& example) const {
  if (std::optional<SceneNode> found = find(key)) return *found;
  throw InputError(document_->file + ":" + std::to_string(line_) + ": " + childPath(key) +
                   ": this key is missing; write " + example);
}

std::vector<SceneNode> SceneNode::getList(const std::string& what) const {
  std::vector<SceneNode> elements;
  if (node_->IsSequence()) {
    for (size_t i = 0; i < node_->size(); ++i) {
      elements.emplace_back((*node_)[i], path_ + "[" + std::to_string(i) + "]", lineOf((*node_)[i], line_), *document_);
    }
  } else if (node_->IsScalar() && !node_->Scalar().empty()) {
    size_t i = 0;
    for (const std::string& part : io::splitList(node_->Scalar())) {
      elements.emplace_back(YAML::Node(part), path_ + "[" + std::to_string(i++) + "]", line_, *document_);
    }
  } else {
    fail(describe() + ", " + what + " is needed");
  }
  return elements;
}

std::vector<SceneNode> SceneNode::getList(size_t count, const std::string& what) const {
  std::vector<SceneNode> elements = getList(what);
  if (elements.size() != count) {
    fail("has " + std::to_string(elements.size()) + (elements.size() == 1 ? " value" : " values") + ", " + what +
         " is needed");
  }
  return elements;
}

std::string SceneNode::getText(const std::string& expected) const {
  if (!node_->IsScalar() || node_->Scalar().empty()) fail(describe() + ", " + expected + " is needed");
  return node_->Scalar();
}

bool SceneNode::getBool() const {
  const std::string text = getText("true or false");
  if (text != "true" && text != "false") fail("is \"" + shorten(text) + "\"; allowed: true, false");
  return text == "true";
}

int SceneNode::getInteger(int lowest, int highest) const {
  const std::string allowed = "an integer from " + std::to_string(lowest) + " to " + std::to_string(highest);
  const std::string text = getText(allowed);
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < lowest || value > highest) {
    fail("is \"" + shorten(text) + "\"; allowed: " + allowed);
  }
  return value;
}

double SceneNode::getQuantity(io::Dimension dimension) const {
  const std::string text =
      getText(std::string("a ") + io::toString(dimension) + " (" + io::acceptedUnits(dimension) + ")");
  return io::parseQuantity(text, dimension, where());
}

double SceneNode::getQuantityOrInfinity(io::Dimension dimension) const {
  const std::string text =
      getText(std::string("a ") + io::toString(dimension) + " (" + io::acceptedUnits(dimension) + ")");
  return io::parseQuantityOrInfinity(text, dimension, where());
}

double SceneNode::getPositive(io::Dimension dimension) const {
  const double value = getQuantity(dimension);
  if (!(value > 0)) fail(describe() + "; allowed: > 0");
  return value;
}

double SceneNode::getNonNegative(io::Dimension dimension) const {
  const double value = getQuantity(dimension);
  if (!(value >= 0)) fail(describe() + "; allowed: >= 0");
  return value;
}

double SceneNode::getBetween(io::Dimension dimension, double lowest, double highest, const std::string& unit) const {
  const double value = getQuantity(dimension);
  if (!(value >= lowest && value <= highest)) {
    const auto write = [&](double x) { return dimension == io::Dimension::dimensionless ? io::formatNumber(x) : io::formatQuantity(x, unit); };
    fail(describe() + "; allowed: " + write(lowest) + " to " + write(highest));
  }
  return value;
}

size_t SceneNode::getChoice(const std::vector<std::string>& allowed) const {
  const std::string text = getText("one of " + io::joinNames(allowed));
  const auto found = std::find(allowed.begin(), allowed.end(), text);
  if (found == allowed.end()) {
    const std::string nearest = io::findNearest(text, allowed);
    fail("is \"" + shorten(text) + "\"" + (nearest.empty() ? "" : " (did you mean \"" + nearest + "\"?)") +
         "; allowed: " + io::joinNames(allowed));
  }
  return static_cast<size_t>(found - allowed.begin());
}

}  // namespace genu::scene
