// Runs a fuzz target without libFuzzer: every file of a corpus, then a fixed number of mutations of them, the same ones on
// every machine. fuzz_replay_NAME CORPUS MUTATIONS [ONLY]; ONLY writes input number ONLY to the file `input` and runs it alone.

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using Bytes = std::vector<std::uint8_t>;

char announcement[64] = "";
volatile int announcementLength = 0;

/** A failed requirement aborts: say which input it was. Sanitizers print their own report after the same line. */
void announceAbort(int) {
  if (write(2, announcement, static_cast<std::size_t>(announcementLength)) < 0) std::_Exit(3);
  std::_Exit(2);
}

/** Numbers that break things, as text and as bytes. */
const char* const kTokens[] = {"0", "-1", "1e308", "-1e308", "1e-308", "1e30", "1e-12", "0.5", "0.49999999", "1000000", "1e400",
                               "null", "[]", "{}", "\"\"", "nan", "true"};

class Mutator {
 public:
  /** mt19937's numbers are fixed by the standard, distributions are not. */
  std::size_t below(std::size_t n) { return n == 0 ? 0 : random_() % n; }

  Bytes mutate(const std::vector<Bytes>& corpus) {
    Bytes b = corpus[below(corpus.size())];
    for (std::size_t times = 1 + below(4); times > 0; --times) mutateOnce(b, corpus);
    return b;
  }

 private:
  void mutateOnce(Bytes& b, const std::vector<Bytes>& corpus) {
    const auto at = [&b](std::size_t i) { return b.begin() + static_cast<std::ptrdiff_t>(i); };
    if (b.empty()) b.push_back(0);
    switch (below(6)) {
      case 0: b[below(b.size())] ^= static_cast<std::uint8_t>(1u << below(8)); break;
      case 1: b[below(b.size())] = static_cast<std::uint8_t>(below(256)); break;
      case 2: {
        const std::size_t from = below(b.size());
        b.erase(at(from), at(std::min(b.size(), from + 1 + below(8))));
        break;
      }
      case 3: {  // copy a piece of another input
        const Bytes& other = corpus[below(corpus.size())];
        if (other.empty()) break;
        const std::size_t from = below(other.size()), length = 1 + below(std::min<std::size_t>(32, other.size() - from));
        const Bytes piece(other.begin() + static_cast<std::ptrdiff_t>(from), other.begin() + static_cast<std::ptrdiff_t>(from + length));
        b.insert(at(below(b.size() + 1)), piece.begin(), piece.end());
        break;
      }
      default: replaceNumber(b); break;
    }
  }

  /** The number at or after a random place becomes another one. */
  void replaceNumber(Bytes& b) {
    const auto isDigit = [](std::uint8_t c) { return (c >= '0' && c <= '9') || c == '.' || c == '-'; };
    std::size_t from = below(b.size());
    while (from < b.size() && !isDigit(b[from])) ++from;
    std::size_t to = from;
    while (to < b.size() && (isDigit(b[to]) || b[to] == 'e')) ++to;
    const std::string token = kTokens[below(std::size(kTokens))];
    const auto at = [&b](std::size_t i) { return b.begin() + static_cast<std::ptrdiff_t>(i); };
    b.erase(at(from), at(to));
    b.insert(at(from), token.begin(), token.end());
  }

  std::mt19937 random_{20040101};
};

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: %s CORPUS MUTATIONS [ONLY]\n", argv[0]);
    return 2;
  }
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::vector<Bytes> corpus;
  for (const auto& file : files) {
    std::ifstream in(file, std::ios::binary);
    corpus.emplace_back(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  }
  if (corpus.empty()) {
    std::fprintf(stderr, "%s: no file\n", argv[1]);
    return 2;
  }
  std::signal(SIGABRT, announceAbort);
  const int count = static_cast<int>(corpus.size()) + std::atoi(argv[2]), only = argc > 3 ? std::atoi(argv[3]) : -1;
  Mutator mutator;
  for (int k = 0; k < count; ++k) {
    const bool stored = k < static_cast<int>(corpus.size());
    const Bytes input = stored ? corpus[static_cast<std::size_t>(k)] : mutator.mutate(corpus);
    if (only >= 0 && k != only) continue;
    announcementLength = std::snprintf(announcement, sizeof announcement, "fuzz replay: input %d failed\n", k);
    if (only >= 0) {
      std::ofstream("input", std::ios::binary).write(reinterpret_cast<const char*>(input.data()), static_cast<std::streamsize>(input.size()));
    }
    LLVMFuzzerTestOneInput(input.data(), input.size());
  }
  std::printf("%d inputs\n", count);
  return 0;
}
