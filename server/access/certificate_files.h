#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "server/access/access_options.h"

namespace pepeseg {

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
