#include "server/access/gateway_identity.h"

#include <grpcpp/security/auth_context.h>
#include <grpcpp/server_context.h>

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "core/base/status_macros.h"
#include "server/access/api_key.h"
#include "server/store/scene_key.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kHeaderPrefix = "x-pepeseg-";
constexpr size_t kMaxSubjectBytes = 128;

// Only certificates that the listener has verified become properties of the connection.
std::vector<std::string> CertificateNames(const grpc::ServerContextBase& context) {
  std::vector<std::string> names;
  const auto connection = context.auth_context();
  if (connection == nullptr) return names;
  for (const char* property : {"x509_common_name", "x509_subject_alternative_name"}) {
    for (const grpc::string_ref& value : connection->FindPropertyValues(property)) {
      names.emplace_back(value.data(), value.size());
    }
  }
  return names;
}

absl::StatusOr<std::string> One(const char* name, const std::vector<std::string>& values) {
  if (values.size() == 1) return values[0];
  return absl::InvalidArgumentError(
      absl::StrCat(kHeaderPrefix, name, " is there ", values.size(), " times, not once"));
}

}  // namespace

Vouching VouchingOf(const grpc::ServerContextBase& context) {
  Vouching vouching;
  for (const auto& [key, value] : context.client_metadata()) {
    const absl::string_view name(key.data(), key.size());
    if (!absl::StartsWith(name, kHeaderPrefix)) continue;
    vouching.is_there = true;
    const std::string text(value.data(), value.size());
    if (name == "x-pepeseg-project") vouching.projects.push_back(text);
    if (name == "x-pepeseg-scopes") vouching.scopes.push_back(text);
    if (name == "x-pepeseg-subject") vouching.subjects.push_back(text);
  }
  if (vouching.is_there) vouching.certificate_names = CertificateNames(context);
  return vouching;
}

absl::StatusOr<VouchedCaller> ReadVouching(const Vouching& vouching) {
  VouchedCaller caller;
  ASSIGN_OR_RETURN(caller.project, One("project", vouching.projects));
  if (!IsRfc1034Label(caller.project)) {
    return absl::InvalidArgumentError("x-pepeseg-project is no name of a project");
  }
  ASSIGN_OR_RETURN(const std::string scopes, One("scopes", vouching.scopes));
  ASSIGN_OR_RETURN(caller.scopes, ScopesFromText(scopes));
  // Whoever operates the server has a key of the server's own.
  if ((caller.scopes & ScopeBit(v1::SCOPE_OPERATE)) != 0) {
    return absl::InvalidArgumentError("x-pepeseg-scopes: no gateway gives the scope operate");
  }
  ASSIGN_OR_RETURN(caller.subject, One("subject", vouching.subjects));
  if (caller.subject.empty() || caller.subject.size() > kMaxSubjectBytes ||
      !std::all_of(caller.subject.begin(), caller.subject.end(), absl::ascii_isgraph)) {
    return absl::InvalidArgumentError("x-pepeseg-subject must be 1 to 128 printable characters");
  }
  return caller;
}

}  // namespace pepeseg
