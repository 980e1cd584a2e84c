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
#include "server/store/resource_id.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kHeaderPrefix = "x-pepeseg-";
constexpr size_t kMaxSubjectBytes = 128;

// Returns the names in the client's certificate. gRPC sets these properties of the connection only
// for certificates that the listener has verified.
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

// Returns the only value of a metadata name, or INVALID_ARGUMENT.
absl::StatusOr<std::string> One(const char* name, const std::vector<std::string>& values) {
  if (values.size() == 1) return values[0];
  return absl::InvalidArgumentError(
      absl::StrCat(kHeaderPrefix, name, " is given ", values.size(), " times, must be given once"));
}

}  // namespace

GatewayMetadata GatewayMetadataOf(const grpc::ServerContextBase& context) {
  GatewayMetadata gateway;
  for (const auto& [key, value] : context.client_metadata()) {
    const absl::string_view name(key.data(), key.size());
    if (!absl::StartsWith(name, kHeaderPrefix)) continue;
    // Any such header counts, also an unknown one: the call then claims to come from a gateway, and
    // is refused unless it does.
    gateway.present = true;
    const std::string text(value.data(), value.size());
    if (name == "x-pepeseg-project") gateway.projects.push_back(text);
    if (name == "x-pepeseg-scopes") gateway.scopes.push_back(text);
    if (name == "x-pepeseg-subject") gateway.subjects.push_back(text);
  }
  if (gateway.present) gateway.certificate_names = CertificateNames(context);
  return gateway;
}

absl::StatusOr<GatewayIdentity> ReadGatewayIdentity(const GatewayMetadata& gateway) {
  GatewayIdentity caller;
  ASSIGN_OR_RETURN(caller.project, One("project", gateway.projects));
  if (!IsRfc1034Label(caller.project)) {
    return absl::InvalidArgumentError("x-pepeseg-project is not the name of a project");
  }
  ASSIGN_OR_RETURN(const std::string scopes, One("scopes", gateway.scopes));
  ASSIGN_OR_RETURN(caller.scopes, ScopesFromText(scopes));
  // Operators use a key of the server.
  if ((caller.scopes & ScopeBit(v1::SCOPE_OPERATE)) != 0) {
    return absl::InvalidArgumentError("x-pepeseg-scopes: a gateway cannot grant the scope operate");
  }
  ASSIGN_OR_RETURN(caller.subject, One("subject", gateway.subjects));
  if (caller.subject.empty() || caller.subject.size() > kMaxSubjectBytes ||
      !std::all_of(caller.subject.begin(), caller.subject.end(), absl::ascii_isgraph)) {
    return absl::InvalidArgumentError("x-pepeseg-subject must be 1 to 128 printable characters");
  }
  return caller;
}

}  // namespace pepeseg
