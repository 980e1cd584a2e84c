#pragma once

#include <cstdint>

namespace pepeseg::client::cli {

// Bytes in MiB, as tables tell them.
inline double Mib(int64_t num_bytes) { return static_cast<double>(num_bytes) / (1 << 20); }

}  // namespace pepeseg::client::cli
