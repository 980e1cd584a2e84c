#include "clients/cpp/checksums.h"

#include <openssl/evp.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <vector>

#include "absl/strings/escaping.h"
#include "clients/cpp/file_bytes.h"

namespace pepeseg::client {
namespace {

constexpr uint32_t kCastagnoli = 0x82f63b78;     // the polynomial, bit-reversed
constexpr size_t kPieceBytes = size_t{1} << 20;  // of one read

// Returns the tables of slicing-by-8 (Kounavis and Berry 2008): table[k][b] is the checksum of byte
// b followed by k zero bytes, so that one step takes eight bytes.
std::array<std::array<uint32_t, 256>, 8> MakeCrcTable() {
  std::array<std::array<uint32_t, 256>, 8> table{};
  for (uint32_t byte = 0; byte < 256; ++byte) {
    uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? kCastagnoli : 0);
    table[0][byte] = crc;
  }
  for (size_t zeros = 1; zeros < table.size(); ++zeros) {
    for (size_t byte = 0; byte < 256; ++byte) {
      const uint32_t crc = table[zeros - 1][byte];
      table[zeros][byte] = (crc >> 8) ^ table[0][crc & 0xff];
    }
  }
  return table;
}

}  // namespace

uint32_t Crc32c(std::string_view bytes) {
  static const auto table = MakeCrcTable();
  // CRC-32C as in RFC 3720: begins with all bits set and is inverted at the end.
  uint32_t crc = ~uint32_t{0};
  size_t i = 0;
  const auto byte_at = [&](size_t k) { return static_cast<uint8_t>(bytes[k]); };
  for (; i + 8 <= bytes.size(); i += 8) {
    uint32_t next = 0;
    for (size_t k = 0; k < 8; ++k) {
      // The checksum so far is added to the first four bytes.
      const uint8_t carried = k < 4 ? static_cast<uint8_t>(crc >> (8 * k)) : 0;
      next ^= table[7 - k][byte_at(i + k) ^ carried];
    }
    crc = next;
  }
  for (; i < bytes.size(); ++i) crc = (crc >> 8) ^ table[0][(crc ^ byte_at(i)) & 0xff];
  return ~crc;
}

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  EVP_DigestInit_ex(static_cast<EVP_MD_CTX*>(context_), EVP_sha256(), nullptr);
}

Sha256::~Sha256() { EVP_MD_CTX_free(static_cast<EVP_MD_CTX*>(context_)); }

void Sha256::Add(std::string_view bytes) {
  EVP_DigestUpdate(static_cast<EVP_MD_CTX*>(context_), bytes.data(), bytes.size());
}

std::string Sha256::Finish() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  EVP_DigestFinal_ex(static_cast<EVP_MD_CTX*>(context_), digest.data(), &size);
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), size});
}

absl::StatusOr<FileDigest> DigestFile(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return LocalFileError("read", path, errno);
  FileDigest digest;
  Sha256 sha256;
  std::vector<char> piece(kPieceBytes);
  while (file) {
    file.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    sha256.Add({piece.data(), static_cast<size_t>(file.gcount())});
    // The size is counted, not asked for: it belongs to the bytes that were hashed.
    digest.size += file.gcount();
  }
  // The loop also ends on a read error, which must not give the digest of half a file.
  if (!file.eof()) return LocalFileError("read", path, errno);
  digest.sha256 = sha256.Finish();
  return digest;
}

}  // namespace pepeseg::client
