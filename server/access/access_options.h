#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// Who may reach a listener, and what it shows of itself.
struct AccessOptions {
  // PEM files; read again when they change, for connections made from then on. Both or none: none
  // is a listener without encryption.
  std::filesystem::path tls_certificate;  // chain, the server's first
  std::filesystem::path tls_key;
  // PEM bundle of those who may sign clients' certificates; given, every client must have one.
  std::filesystem::path tls_client_ca;
  // Calls must carry a key of theirs (proto/pepeseg/v1/access.proto). Without it everybody may do
  // everything, in the project "default".
  bool require_keys = false;
  // Name (CN, or one of the alternative names) in a client's certificate: who has that says who
  // calls by metadata (access.proto). Needs keys and a client CA. Empty: nobody may.
  std::string trusted_gateway;
};

// PEM texts that belong together.
struct CertificateTexts {
  std::string chain;
  std::string key;
  std::string client_ca;  // empty: clients need no certificate

  bool operator==(const CertificateTexts&) const = default;
};

// Half a pair, or a client CA without one: FAILED_PRECONDITION names the flag that is missing.
absl::Status CheckCertificateOptions(const AccessOptions& options);

// The files of the options, whose certificate must be set. FAILED_PRECONDITION names the file: it
// cannot be read, is no PEM of its kind, or is a key that is not the certificate's.
absl::StatusOr<CertificateTexts> ReadCertificateFiles(const AccessOptions& options);

}  // namespace pepeseg
