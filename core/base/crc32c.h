#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace pepeseg {

// Returns the CRC-32C (Castagnoli polynomial, as in iSCSI and in storage services over gRPC) of
// `bytes`. To compute it piece by piece, pass the CRC of the preceding bytes as `crc`; 0: none.
uint32_t Crc32c(std::span<const uint8_t> bytes, uint32_t crc = 0);
uint32_t Crc32c(const std::string& bytes, uint32_t crc = 0);

}  // namespace pepeseg
