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
#include "server/api/resource_name.h"
#include "server/store/store.h"

namespace grpc {
class ServerContextBase;
}

namespace pepeseg {

// Where a call comes from, and its credentials.
struct CallOrigin {
  std::string peer;                        // gRPC's name for the other end of the connection
  std::vector<std::string> authorization;  // all values of that metadata: "Bearer pk_..."
  GatewayMetadata gateway = {};
  std::string request_id = {};  // as the interceptor has set it
};
CallOrigin OriginOf(const grpc::ServerContextBase& context);

// An authorised caller.
struct Caller {
  std::string project = kDefaultProject;
  std::string key;                 // id; empty: no key
  int scopes = 0;                  // as KeyRecord::scopes
  std::string subject;             // of the gateway identity; empty: none
  bool sees_all_projects = false;  // the server requires no keys

  // Returns the project whose scenes and jobs lists show; empty: all projects.
  std::string visible_project() const { return sees_all_projects ? "" : project; }
};

// A caller, and the scenes that the request names.
struct AuthorizedCaller : Caller {
  NamedScenes scenes;
};

// Decides whether a call is allowed, by the rules of access.proto, before anything else looks at
// it, and writes the audit log. Caches nothing between calls: a revoked key or a deleted scene is
// gone for the next call. Blocks on the store. Thread safe.
class Authorizer {
 public:
  // `require_keys`: if false, everybody may do everything. `trusted_gateway`: certificate name of
  // the gateway whose identity metadata is trusted; empty: none. Calls without a valid key or
  // gateway identity go to `refusals`, all others to `audit`.
  Authorizer(Store* store, AuditLog* audit, RefusalLog* refusals, bool require_keys,
             std::string trusted_gateway = "")
      : store_(store),
        audit_(audit),
        refusals_(refusals),
        require_keys_(require_keys),
        trusted_gateway_(std::move(trusted_gateway)) {}

  // Returns who calls and the scenes that the request names, or UNAUTHENTICATED or
  // PERMISSION_DENIED, both with an ErrorDetail and recorded in one of the logs, or the store's
  // error if it cannot be asked, or those of ResolveSceneNames. A request that names
  // no resource, such as a default instance, has only key and scope checked; this is all that is
  // known when a stream begins.
  absl::StatusOr<AuthorizedCaller> Authorize(const CallOrigin& origin,
                                             const google::protobuf::Message& request);

  // Returns OK if a caller may use gRPC's reflection, which needs a valid key or gateway identity
  // of any scope, or the errors of Authorize.
  absl::Status AuthorizeReflection(const CallOrigin& origin);

  // Records in the audit log that an authorised call begins, if its method may change something.
  // Returns what Record needs to know. Called before the call changes anything: whatever becomes of
  // the call, its client or the server, the log then has the change.
  std::string Begin(const CallOrigin& origin, const Caller& caller,
                    const google::protobuf::Message& request);
  // Records how an authorised call ended, unless its method only reads. `begun`: as Begin returned
  // it.
  void Record(const CallOrigin& origin, const Caller& caller,
              const google::protobuf::Message& request, const absl::Status& outcome,
              const std::string& begun);

  // Runs a whole call: authorises it, and calls `call` between Begin and Record.
  absl::Status Run(const CallOrigin& origin, const google::protobuf::Message& request,
                   absl::FunctionRef<absl::Status(const AuthorizedCaller&)> call);

 private:
  struct Verdict;
  // Finds out who calls.
  Verdict Identify(const CallOrigin& origin);
  Verdict Decide(const CallOrigin& origin, const google::protobuf::Message& request);
  // Returns the decision that allows the call, or records the refusal and returns it.
  absl::StatusOr<Verdict> Admit(const CallOrigin& origin, const google::protobuf::Message& request);
  // Records a refusal in one of the logs, and returns it.
  absl::Status Refused(const Verdict& verdict, AuditEntry entry);
  // Looks up the call's key and sets the caller in `verdict`, or refuses.
  void CheckKey(const CallOrigin& origin, Verdict& verdict);
  // Sets the caller from the metadata of a trusted gateway, or refuses.
  void CheckGateway(const CallOrigin& origin, Verdict& verdict) const;
  // Refuses unless all resources that the request names are of the caller's project.
  void CheckResources(const MethodAccess& access, const google::protobuf::Message& request,
                      Verdict& verdict);

  Store* const store_;
  AuditLog* const audit_;
  RefusalLog* const refusals_;
  const bool require_keys_;
  const std::string trusted_gateway_;
};

}  // namespace pepeseg
