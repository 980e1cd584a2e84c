#pragma once

#include <filesystem>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace pepeseg {

// Encryption of a listener, and who may call.
struct AccessOptions {
  // PEM files, read again when they change and used for connections made from then on. Both or
  // neither; neither: no encryption.
  std::filesystem::path tls_certificate;  // the chain, beginning with the server's certificate
  std::filesystem::path tls_key;
  // PEM bundle of the authorities that may sign client certificates. If set, every client must
  // present one.
  std::filesystem::path tls_client_ca;
  // Calls must carry a key (proto/pepeseg/v1/access.proto). If false, everybody may do everything,
  // in the project "default".
  bool require_keys = false;
  // Name (CN or one of the alternative names) in the client certificate of the gateway, which says
  // by metadata who calls (access.proto). Needs keys and a client CA. Empty: no gateway is trusted.
  std::string trusted_gateway;
};

// The contents of the certificate files, in PEM.
struct CertificateTexts {
  std::string chain;
  std::string key;
  std::string client_ca;  // empty: clients need no certificate

  bool operator==(const CertificateTexts&) const = default;
};

// Returns FAILED_PRECONDITION, naming the missing flag, if an option is set without one that it
// needs: half a pair, a client CA without a certificate, a gateway without a client CA or keys.
absl::Status CheckCertificateOptions(const AccessOptions& options);

// Reads the files of `options`, whose certificate must be set. FAILED_PRECONDITION, naming the
// file: it cannot be read, is not PEM of its kind, or is not the certificate's key.
absl::StatusOr<CertificateTexts> ReadCertificateFiles(const AccessOptions& options);

}  // namespace pepeseg
