#pragma once

#include <google/protobuf/message.h>

#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/access/audit_log.h"
#include "server/access/gateway_identity.h"
#include "server/access/method_access.h"
#include "server/store/store.h"

namespace grpc {
class ServerContextBase;
}

namespace pepeseg {

// Where a call comes from, and what it shows.
struct CallOrigin {
  std::string peer;
  std::vector<std::string> authorization;  // each "Bearer pk_..."
  GatewayMetadata gateway = {};
  std::string request_id = {};  // as the interceptor has set it
};
CallOrigin OriginOf(const grpc::ServerContextBase& context);

// Who calls.
struct Caller {
  std::string project = kDefaultProject;
  std::string key;                 // id; empty: it has none
  int scopes = 0;                  // KeyRow::scopes
  std::string subject;             // whom a gateway vouches for; empty: none does
  bool sees_all_projects = false;  // the server asks nobody who they are

  // Whose scenes and jobs lists show; empty: those of all projects.
  std::string visible_project() const { return sees_all_projects ? "" : project; }
};

// Decides over every call before anything else looks at it, as access.proto says, and writes the
// audit log. Keeps nothing between calls: a revoked key or a deleted scene is gone for the next
// one. Blocks on the store. Thread safe.
class Authorizer {
 public:
  // `require_keys` false: everybody may do everything. `trusted_gateway`: the name in the
  // certificate of who may vouch for callers; empty: nobody may. `refusals` gets what callers
  // without a valid key are refused, `audit` all else.
  Authorizer(Store* store, AuditLog* audit, RefusalLog* refusals, bool require_keys,
             std::string trusted_gateway = "")
      : store_(store),
        audit_(audit),
        refusals_(refusals),
        require_keys_(require_keys),
        trusted_gateway_(std::move(trusted_gateway)) {}

  // UNAUTHENTICATED or PERMISSION_DENIED, both with an ErrorDetail and in one of the logs; the
  // store's own error when it cannot be asked. Of a request without resources, as a default
  // instance, key and scope are checked: what can be known when a stream begins.
  absl::StatusOr<Caller> Authorize(const CallOrigin& origin,
                                   const google::protobuf::Message& request);

  // Writes down how an authorised call ended, if it changes something.
  void Record(const CallOrigin& origin, const Caller& caller,
              const google::protobuf::Message& request, const absl::Status& outcome);

  // Authorize, then ResolveSceneNames: for a message of a stream.
  absl::StatusOr<Caller> AuthorizeAndResolve(const CallOrigin& origin,
                                             google::protobuf::Message& request);

  // All of a call: authorises it, resolves the names in its request (which must be no constant),
  // does it, records it.
  absl::Status Run(const CallOrigin& origin, const google::protobuf::Message& request,
                   absl::FunctionRef<absl::Status(const Caller&)> call);

 private:
  struct Verdict;
  Verdict Decide(const CallOrigin& origin, const google::protobuf::Message& request);
  // The key's row in `verdict`, or why it opens nothing.
  void CheckKey(const CallOrigin& origin, Verdict& verdict);
  // The same of a call with metadata by which a gateway vouches for its caller.
  void CheckGateway(const CallOrigin& origin, Verdict& verdict) const;
  void CheckResources(const MethodAccess& access, const google::protobuf::Message& request,
                      Verdict& verdict);
  // Whether the project has what is so named. INVALID_ARGUMENT: nothing can have the name.
  absl::StatusOr<bool> IsOf(const std::string& project, const std::string& resource);

  Store* const store_;
  AuditLog* const audit_;
  RefusalLog* const refusals_;
  const bool require_keys_;
  const std::string trusted_gateway_;
};

}  // namespace pepeseg
