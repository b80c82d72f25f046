#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

namespace genu::fuzz {

/** Reads numbers from the fuzzer's bytes; zeros when they run out. */
struct Source {
  const std::uint8_t* data;
  std::size_t left;

  /** In [-1, 1), any bit pattern of two bytes. */
  double next() { return take<std::int16_t>() / 32768.0; }
  /** 0 .. count - 1, of one byte. */
  int choose(int count) { return take<std::uint8_t>() % count; }
  /** Any bit pattern of eight bytes: NaN, infinity, subnormal. */
  double any() { return take<double>(); }

 private:
  template <class T>
  T take() {
    T value{};
    const std::size_t n = left < sizeof value ? left : sizeof value;
    if (n > 0) std::memcpy(&value, data, n);
    data += n;
    left -= n;
    return value;
  }
};

/** What must hold for every input. */
inline void require(bool ok) {
  if (!ok) std::abort();
}

}  // namespace genu::fuzz
