#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg {

// CRC-32C (Castagnoli), as in iSCSI and gRPC storage services. `crc`: that of the bytes before.
uint32_t Crc32c(std::span<const uint8_t> bytes, uint32_t crc = 0);
uint32_t Crc32c(const std::string& bytes, uint32_t crc = 0);

}  // namespace pepeseg
