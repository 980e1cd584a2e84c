#include "clients/cpp/digest.h"

#include <openssl/evp.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <vector>

#include "absl/strings/escaping.h"
#include "clients/cpp/file_bytes.h"

namespace pepeseg::client {
namespace {

constexpr size_t kPieceBytes = size_t{1} << 20;  // of one read

}  // namespace

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
