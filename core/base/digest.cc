#include "core/base/digest.h"

#include <openssl/evp.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"

namespace pepeseg {
namespace {

// Ends the process if an OpenSSL call failed. That happens only without memory or without the
// algorithm, and a wrong digest must never be stored or compared.
void RequireSuccess(int result) {
  if (result != 1) std::abort();
}

constexpr uint32_t kPolynomial = 0x82f63b78;  // 0x1edc6f41 with its bits reversed

using Tables = std::array<std::array<uint32_t, 256>, 8>;

// tables[k][b] is the remainder of byte b followed by k zero bytes. With it, eight bytes take eight
// independent look-ups in place of a chain of eight ("slicing by 8": Kounavis and Berry, 2005).
constexpr Tables MakeTables() {
  Tables tables{};
  for (uint32_t b = 0; b < 256; ++b) {
    uint32_t crc = b;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) != 0 ? kPolynomial : 0);
    tables[0][b] = crc;
  }
  for (uint32_t b = 0; b < 256; ++b) {
    for (size_t k = 1; k < 8; ++k) {
      tables[k][b] = (tables[k - 1][b] >> 8) ^ tables[0][tables[k - 1][b] & 0xff];
    }
  }
  return tables;
}

constexpr Tables kTables = MakeTables();

}  // namespace

// OpenSSL's context, kept out of the header.
struct Sha256::State {
  struct Free {
    void operator()(EVP_MD_CTX* context) const { EVP_MD_CTX_free(context); }
  };
  std::unique_ptr<EVP_MD_CTX, Free> context{EVP_MD_CTX_new()};
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  RequireSuccess(EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr));
}
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;
Sha256::~Sha256() = default;

void Sha256::Add(std::string_view bytes) {
  RequireSuccess(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()));
}

void Sha256::Add(std::span<const uint8_t> bytes) {
  RequireSuccess(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()));
}

std::string Sha256::Hex() {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned int size = 0;
  RequireSuccess(EVP_DigestFinal_ex(state_->context.get(), digest.data(), &size));
  return absl::BytesToHexString({reinterpret_cast<const char*>(digest.data()), size});
}

std::string Sha256Hex(std::string_view bytes) {
  Sha256 digest;
  digest.Add(bytes);
  return digest.Hex();
}

absl::StatusOr<std::string> Sha256OfFile(const std::filesystem::path& path) {
  constexpr size_t kBlock = size_t{1} << 20;
  std::ifstream file(path, std::ios::binary);
  if (!file) return absl::ErrnoToStatus(errno, absl::StrCat("cannot open ", path.string()));
  // Block by block, so that memory does not grow with the file.
  Sha256 digest;
  std::vector<char> block(kBlock);
  while (file) {
    file.read(block.data(), kBlock);
    digest.Add(std::string_view(block.data(), static_cast<size_t>(file.gcount())));
  }
  if (!file.eof()) return absl::InternalError(absl::StrCat("cannot read ", path.string()));
  return digest.Hex();
}

static_assert(std::endian::native == std::endian::little);

uint32_t Crc32c(std::span<const uint8_t> bytes, uint32_t crc) {
  crc = ~crc;
  const uint8_t* p = bytes.data();
  size_t left = bytes.size();
  for (; left >= 8; left -= 8, p += 8) {
    uint64_t word = 0;
    std::memcpy(&word, p, 8);
    word ^= crc;  // the CRC so far belongs to the first four of these bytes
    crc = 0;
    for (size_t k = 0; k < 8; ++k) crc ^= kTables[7 - k][(word >> (8 * k)) & 0xff];
  }
  // The last up to seven bytes, one by one.
  for (; left > 0; --left, ++p) crc = (crc >> 8) ^ kTables[0][(crc ^ *p) & 0xff];
  return ~crc;
}

uint32_t Crc32c(const std::string& bytes, uint32_t crc) {
  return Crc32c(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()), crc);
}

}  // namespace pepeseg
