#include "server/access/access_options.h"

#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"

namespace pepeseg {
namespace {

constexpr int64_t kMaxFileBytes = int64_t{1} << 20;

struct Free {
  void operator()(BIO* bio) const { BIO_free(bio); }
  void operator()(X509* certificate) const { X509_free(certificate); }
  void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
};
using Bio = std::unique_ptr<BIO, Free>;
using Certificate = std::unique_ptr<X509, Free>;
using Key = std::unique_ptr<EVP_PKEY, Free>;

absl::Status BadFile(const std::filesystem::path& path, const std::string& what) {
  ERR_clear_error();  // OpenSSL's error queue is per thread: leave nothing for the next caller
  return absl::FailedPreconditionError(absl::StrCat(path.string(), ": ", what));
}

absl::StatusOr<std::string> ReadText(const std::filesystem::path& path) {
  std::error_code error;
  const auto size = std::filesystem::file_size(path, error);
  if (error) return BadFile(path, absl::StrCat("cannot be read: ", error.message()));
  // A path that was given by mistake must not fill the memory.
  if (size > kMaxFileBytes)
    return BadFile(path, "is larger than 1 MiB: not a PEM file of certificates");
  std::ifstream file(path, std::ios::binary);
  std::string text(size, '\0');
  if (!file.read(text.data(), static_cast<std::streamsize>(size))) {
    return BadFile(path, "cannot be read");
  }
  return text;
}

Bio OpenText(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

// Passphrase callback that has none. Without it OpenSSL would ask on the terminal.
int NoPassphrase(char*, int, int, void*) { return -1; }

// The server's own certificate is the first of its chain.
Certificate FirstCertificate(const std::string& text) {
  return Certificate(PEM_read_bio_X509(OpenText(text).get(), nullptr, NoPassphrase, nullptr));
}

absl::Status CheckPair(const CertificateTexts& texts, const AccessOptions& options) {
  const Certificate certificate = FirstCertificate(texts.chain);
  if (certificate == nullptr) return BadFile(options.tls_certificate, "no certificate in PEM");
  const Key key(PEM_read_bio_PrivateKey(OpenText(texts.key).get(), nullptr, NoPassphrase, nullptr));
  if (key == nullptr) return BadFile(options.tls_key, "no private key in PEM without passphrase");
  if (X509_check_private_key(certificate.get(), key.get()) != 1) {
    return BadFile(options.tls_key,
                   absl::StrCat("not the key of ", options.tls_certificate.string()));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckCertificateOptions(const AccessOptions& options) {
  const auto missing = [](const char* there, const char* wanted) {
    return absl::FailedPreconditionError(absl::StrCat(there, " is given without ", wanted));
  };
  if (options.tls_certificate.empty() && !options.tls_key.empty()) {
    return missing("--tls-key", "--tls-certificate");
  }
  if (!options.tls_certificate.empty() && options.tls_key.empty()) {
    return missing("--tls-certificate", "--tls-key");
  }
  if (options.tls_certificate.empty() && !options.tls_client_ca.empty()) {
    return missing("--tls-client-ca", "--tls-certificate and --tls-key");
  }
  if (!options.trusted_gateway.empty() && options.tls_client_ca.empty()) {
    return missing("--trusted-gateway", "--tls-client-ca, which verifies its certificate");
  }
  if (!options.trusted_gateway.empty() && !options.require_keys) {
    return missing("--trusted-gateway",
                   "--require-keys, without which everybody may do everything");
  }
  return absl::OkStatus();
}

absl::StatusOr<CertificateTexts> ReadCertificateFiles(const AccessOptions& options) {
  RETURN_IF_ERROR(CheckCertificateOptions(options));
  CertificateTexts texts;
  ASSIGN_OR_RETURN(texts.chain, ReadText(options.tls_certificate));
  // The two files may be replaced one after the other: CheckPair refuses a key of another
  // certificate, and the old pair stays in use until both fit.
  ASSIGN_OR_RETURN(texts.key, ReadText(options.tls_key));
  RETURN_IF_ERROR(CheckPair(texts, options));
  if (options.tls_client_ca.empty()) return texts;
  ASSIGN_OR_RETURN(texts.client_ca, ReadText(options.tls_client_ca));
  if (FirstCertificate(texts.client_ca) == nullptr) {
    return BadFile(options.tls_client_ca, "no certificate in PEM");
  }
  return texts;
}

}  // namespace pepeseg
