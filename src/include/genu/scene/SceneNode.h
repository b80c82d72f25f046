#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "genu/io/Units.h"
#include "genu/scene/Errors.h"

namespace YAML {
class Node;
}

namespace genu::scene {

/** What all nodes of one document share. */
struct SceneDocument {
  std::string file;
  std::map<std::string, int> keyLines;  ///< filled as keys are read
};

/** A value of a scene file that knows its place. Every message begins "file:line: key.path: ". */
class SceneNode {
 public:
  SceneNode(const YAML::Node& node, std::string path, int line, SceneDocument& document);

  /** Parses a whole text; exactly one document. @throws InputError with the line of a syntax error */
  static SceneNode parse(const std::string& text, SceneDocument& document);

  const std::string& path() const { return path_; }
  int line() const { return line_; }
  std::string where() const;
  [[noreturn]] void fail(const std::string& what) const;

  bool isMap() const;
  bool isScalar() const;
  bool isSequence() const;

  /** Keys and values of a mapping in the order of the file. @throws InputError not a mapping, a repeated or empty key
   */
  std::vector<std::pair<std::string, SceneNode>> items() const;
  /** @throws InputError not a mapping, a key that is not allowed (naming the nearest one), a repeated key */
  void requireKeys(const std::vector<std::string>& allowed) const;
  std::optional<SceneNode> find(const std::string& key) const;
  /** @throws InputError when the key is missing; `example` shows what to write */
  SceneNode get(const std::string& key, const std::string& example) const;
  /** A key's path below this one, for messages about keys that are absent. */
  std::string childPath(const std::string& key) const { return path_.empty() ? key : path_ + "." + key; }

  /** Elements of a sequence, or of a text with commas: "0 mm, 1 mm". @throws InputError another count */
  std::vector<SceneNode> getList(size_t count, const std::string& what) const;
  std::vector<SceneNode> getList(const std::string& what) const;

  /** @throws InputError not a scalar, or empty */
  std::string getText(const std::string& expected) const;
  bool getBool() const;
  int getInteger(int lowest, int highest) const;
  double getQuantity(io::Dimension dimension) const;
  double getQuantityOrInfinity(io::Dimension dimension) const;
  /** > 0 */
  double getPositive(io::Dimension dimension) const;
  /** >= 0 */
  double getNonNegative(io::Dimension dimension) const;
  /** lowest to highest, both in SI and both allowed; the message writes them in `unit`. */
  double getBetween(io::Dimension dimension, double lowest, double highest, const std::string& unit) const;
  /** Index of the text in `allowed`. */
  size_t getChoice(const std::vector<std::string>& allowed) const;

 private:
  std::string describe() const;

  std::shared_ptr<const YAML::Node> node_;  // yaml-cpp stays out of public headers
  std::string path_;
  int line_;
  SceneDocument* document_;
};

}  // namespace genu::scene
