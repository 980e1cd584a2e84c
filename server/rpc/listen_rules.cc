#include "server/rpc/listen_rules.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "core/status_macros.h"
#include "server/access/certificate_files.h"

namespace pepeseg {

bool IsLoopback(const std::string& listen) {
  if (listen.rfind("unix:", 0) == 0) return true;
  const size_t colon = listen.rfind(':');
  if (colon == std::string::npos) return false;
  const std::string host = listen.substr(0, colon);
  if (host == "localhost" || host == "[::1]") return true;
  // All of 127.0.0.0/8, but no name that only begins so.
  return host.rfind("127.", 0) == 0 && host.find_first_not_of("0123456789.") == std::string::npos;
}

absl::Status CheckListeners(const ServerOptions& options) {
  RETURN_IF_ERROR(CheckCertificateOptions(options.access));
  if (!options.metrics.empty() && !options.insecure && !IsLoopback(options.metrics)) {
    return absl::FailedPreconditionError(
        absl::StrCat("metrics on ", options.metrics,
                     " go over plain HTTP: use a loopback address, or --insecure if the network is "
                     "trusted"));
  }
  for (const std::string& listen : {options.listen, options.admin}) {
    if (listen.empty() || options.insecure || IsLoopback(listen)) continue;
    if (options.access.tls_certificate.empty()) {
      return absl::FailedPreconditionError(
          absl::StrCat("listening on ", listen,
                       " would let other machines in without encryption: use a loopback address, "
                       "--tls-certificate and --tls-key, or --insecure if the network is trusted"));
    }
    if (!options.access.require_keys) {
      return absl::FailedPreconditionError(
          absl::StrCat("listening on ", listen,
                       " would let everybody do everything: use a loopback address, "
                       "--require-keys, or --insecure if whoever gets that far is trusted"));
    }
  }
  return absl::OkStatus();
}

}  // namespace pepeseg
