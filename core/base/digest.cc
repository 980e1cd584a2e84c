#include "core/base/digest.h"

#include <openssl/evp.h>

#include <array>
#include <cerrno>
#include <cstdlib>
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

}  // namespace pepeseg
