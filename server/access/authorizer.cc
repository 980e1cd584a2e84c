#include "server/access/authorizer.h"

#include <grpcpp/server_context.h>

#include <algorithm>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/access/api_key.h"
#include "server/access/scene_names.h"
#include "server/store/error_detail.h"

namespace pepeseg {
namespace {

constexpr absl::string_view kScheme = "Bearer ";

absl::Status Refusal(absl::StatusCode code, const std::string& reason, const std::string& message) {
  return WithDetail(absl::Status(code, message), {.reason = reason});
}

absl::Status NoKeyError() {
  return Refusal(absl::StatusCode::kUnauthenticated, "NO_KEY",
                 "this server requires a key: metadata 'authorization: Bearer pk_...'");
}

// The message is the same for all invalid keys, so that nobody learns which ones existed.
absl::Status BadKeyError() {
  return Refusal(absl::StatusCode::kUnauthenticated, "BAD_KEY",
                 "the key is unknown, revoked or expired");
}

// Also returned on a server without keys: it would ignore the metadata, and callers whom the
// gateway keeps apart would silently share everything.
absl::Status NotTheGatewayError() {
  return Refusal(
      absl::StatusCode::kUnauthenticated, "NOT_A_GATEWAY",
      "metadata x-pepeseg-... is accepted only from the gateway whose certificate this server "
      "trusts (--trusted-gateway)");
}

absl::Status BadIdentityError(const std::string& what) {
  return Refusal(absl::StatusCode::kUnauthenticated, "BAD_VOUCHING",
                 absl::StrCat("the gateway's identity metadata is invalid: ", what));
}

absl::Status MissingScopeError(v1::Scope scope) {
  return WithDetail(absl::PermissionDeniedError(absl::StrCat(
                        "the key lacks ", v1::Scope_Name(scope), ", which this call needs")),
                    {.reason = "MISSING_SCOPE", .limit = v1::Scope_Name(scope)});
}

}  // namespace

CallOrigin OriginOf(const grpc::ServerContextBase& context) {
  CallOrigin origin;
  origin.peer = context.peer();
  const auto [begin, end] = context.client_metadata().equal_range("authorization");
  for (auto it = begin; it != end; ++it) {
    origin.authorization.emplace_back(it->second.data(), it->second.size());
  }
  origin.gateway = GatewayMetadataOf(context);
  const auto id = context.client_metadata().find("x-request-id");
  if (id != context.client_metadata().end()) {
    origin.request_id.assign(id->second.data(), id->second.size());
  }
  return origin;
}

// A decision, with what the log records of it.
struct Authorizer::Verdict {
  absl::Status status;
  std::string reason;  // of a refusal, for the log only; may say more than `status` reveals
  Caller caller;
  bool is_known = false;  // the caller's key or gateway is valid
  // The scenes that the request names. An error for a caller who sees all projects is the call's,
  // and no refusal.
  absl::StatusOr<NamedScenes> scenes = NamedScenes();

  void Refuse(absl::Status error, const std::string& why) {
    status = std::move(error);
    reason = why;
  }
};

// The log gets the precise reason; the caller gets the same error for all keys that are not valid.
void Authorizer::CheckKey(const CallOrigin& origin, Verdict& verdict) {
  if (origin.authorization.empty()) return verdict.Refuse(NoKeyError(), "NO_KEY");
  const std::string& header = origin.authorization[0];
  // Schemes are case-insensitive (RFC 9110).
  const bool is_bearer = absl::StartsWithIgnoreCase(header, kScheme);
  const std::string secret = is_bearer ? header.substr(kScheme.size()) : "";
  // With two headers it would be unclear which one counts.
  if (origin.authorization.size() > 1 || !LooksLikeSecret(secret)) {
    return verdict.Refuse(BadKeyError(), "MALFORMED_KEY");
  }
  const std::string digest = DigestOfSecret(secret);
  const absl::StatusOr<KeyRecord> key = store_->keys().FindKeyByDigest(digest);
  if (absl::IsNotFound(key.status())) return verdict.Refuse(BadKeyError(), "UNKNOWN_KEY");
  // The database cannot be asked: an error of its own, since the key may be valid.
  if (!key.ok()) return verdict.Refuse(key.status(), "");
  if (!SameDigest(key->sha256, digest)) return verdict.Refuse(BadKeyError(), "UNKNOWN_KEY");
  // Set before the key is found revoked or expired, so that the audit log names it.
  verdict.caller.project = key->project;
  verdict.caller.key = key->id;
  verdict.caller.scopes = key->scopes;
  if (IsRevoked(*key)) return verdict.Refuse(BadKeyError(), "REVOKED_KEY");
  if (IsExpired(*key, absl::Now())) return verdict.Refuse(BadKeyError(), "EXPIRED_KEY");
}

void Authorizer::CheckGateway(const CallOrigin& origin, Verdict& verdict) const {
  const std::vector<std::string>& names = origin.gateway.certificate_names;
  // The certificate was verified by the listener against its client CA; here only its name is
  // compared.
  if (!require_keys_ || trusted_gateway_.empty() ||
      std::find(names.begin(), names.end(), trusted_gateway_) == names.end()) {
    return verdict.Refuse(NotTheGatewayError(), "NOT_A_GATEWAY");
  }
  // With a key and an identity it would be unclear who calls.
  if (!origin.authorization.empty()) {
    return verdict.Refuse(BadIdentityError("the call also has an authorization"), "BAD_VOUCHING");
  }
  const absl::StatusOr<GatewayIdentity> identity = ReadGatewayIdentity(origin.gateway);
  if (!identity.ok()) {
    return verdict.Refuse(BadIdentityError(std::string(identity.status().message())),
                          "BAD_VOUCHING");
  }
  verdict.caller.project = identity->project;
  verdict.caller.scopes = identity->scopes;
  verdict.caller.subject = identity->subject;
}

void Authorizer::CheckResources(const MethodAccess& access,
                                const google::protobuf::Message& request, Verdict& verdict) {
  for (const NamedResource& resource : ResourcesOf(access, request)) {
    const std::vector<std::string> parts = absl::StrSplit(resource.name, '/');
    if (parts.size() < 2 || parts[0] != "jobs") continue;
    // Job ids are unique over all projects, so the job's scene decides.
    const absl::StatusOr<std::string> of = store_->jobs().ProjectOfJob(parts[1]);
    // Malformed names are left to the handler's validation; rejecting them here would reveal
    // nothing extra.
    if (absl::IsInvalidArgument(of.status())) continue;
    if (absl::IsNotFound(of.status()) || (of.ok() && *of != verdict.caller.project)) {
      return verdict.Refuse(NotYoursError(resource.field), "NOT_YOURS");
    }
    if (!of.ok()) return verdict.Refuse(of.status(), "");
  }
  const absl::Status& found = verdict.scenes.status();
  if (!found.ok()) verdict.Refuse(found, absl::IsPermissionDenied(found) ? "NOT_YOURS" : "");
}

Authorizer::Verdict Authorizer::Identify(const CallOrigin& origin) {
  Verdict verdict;
  if (!require_keys_ && !origin.gateway.present) {
    verdict.caller.scopes = AllScopes();
    verdict.caller.sees_all_projects = true;
    return verdict;
  }
  origin.gateway.present ? CheckGateway(origin, verdict) : CheckKey(origin, verdict);
  verdict.is_known = verdict.status.ok();
  return verdict;
}

// Checks in this order: identity, scope, resources. An unknown caller learns nothing about methods
// or resources, and a caller without the scope learns nothing about resources.
Authorizer::Verdict Authorizer::Decide(const CallOrigin& origin,
                                       const google::protobuf::Message& request) {
  Verdict verdict = Identify(origin);
  if (!verdict.status.ok()) return verdict;
  if (verdict.caller.sees_all_projects) {
    verdict.scenes = ResolveSceneNames(*store_, verdict.caller, request);
    return verdict;
  }
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  if (access == nullptr) {
    verdict.Refuse(Refusal(absl::StatusCode::kPermissionDenied, "NO_SCOPE",
                           "the method declares no scope, so nobody may call it"),
                   "NO_SCOPE");
  } else if ((verdict.caller.scopes & ScopeBit(access->scope)) == 0) {
    verdict.Refuse(MissingScopeError(access->scope), "MISSING_SCOPE");
  } else if (access->scope != v1::SCOPE_OPERATE) {  // operators' calls are for all projects
    verdict.scenes = ResolveSceneNames(*store_, verdict.caller, request);
    CheckResources(*access, request, verdict);
  }
  return verdict;
}

namespace {

// Adds the names in a request that has no resources to check: a scene to be created, a model that
// an operator loads.
void AddOtherNames(const google::protobuf::Message& request, AuditEntry& entry) {
  for (const char* name : {"name", "scene_id", "project"}) {
    const auto* field = request.GetDescriptor()->FindFieldByName(name);
    if (field == nullptr || field->type() != google::protobuf::FieldDescriptor::TYPE_STRING) {
      continue;
    }
    std::string value = request.GetReflection()->GetString(request, field);
    if (!value.empty()) entry.resources.push_back(std::move(value));
  }
}

AuditEntry EntryOf(const CallOrigin& origin, const Caller& caller) {
  AuditEntry entry;
  entry.key = caller.key;
  entry.project = caller.project;
  entry.subject = caller.subject;
  entry.peer = origin.peer;
  return entry;
}

AuditEntry EntryOf(const CallOrigin& origin, const Caller& caller, const MethodAccess* access,
                   const google::protobuf::Message& request) {
  AuditEntry entry = EntryOf(origin, caller);
  entry.method = access != nullptr ? access->method : request.GetTypeName();
  if (access == nullptr) return entry;
  for (NamedResource& resource : ResourcesOf(*access, request)) {
    entry.resources.push_back(std::move(resource.name));
  }
  if (access->resources.empty()) AddOtherNames(request, entry);
  return entry;
}

// Returns whether a method may change something. An operator's methods have one scope, but those
// that only read are named so.
bool MayChange(const MethodAccess& access) {
  if (access.scope == v1::SCOPE_READ) return false;
  const std::string name = access.method.substr(access.method.rfind('.') + 1);
  return !absl::StartsWith(name, "Get") && !absl::StartsWith(name, "List");
}

}  // namespace

absl::StatusOr<Authorizer::Verdict> Authorizer::Admit(const CallOrigin& origin,
                                                      const google::protobuf::Message& request) {
  Verdict verdict = Decide(origin, request);
  if (verdict.status.ok()) return verdict;
  return Refused(verdict, EntryOf(origin, verdict.caller,
                                  FindMethodAccess(*request.GetDescriptor()), request));
}

absl::StatusOr<AuthorizedCaller> Authorizer::Authorize(const CallOrigin& origin,
                                                       const google::protobuf::Message& request) {
  ASSIGN_OR_RETURN(Verdict verdict, Admit(origin, request));
  RETURN_IF_ERROR(verdict.scenes.status());
  return AuthorizedCaller{std::move(verdict.caller), *std::move(verdict.scenes)};
}

absl::Status Authorizer::AuthorizeReflection(const CallOrigin& origin) {
  const Verdict verdict = Identify(origin);
  if (verdict.status.ok()) return absl::OkStatus();
  AuditEntry entry = EntryOf(origin, verdict.caller);
  entry.method = "grpc.reflection";
  return Refused(verdict, std::move(entry));
}

absl::Status Authorizer::Refused(const Verdict& verdict, AuditEntry entry) {
  if (entry.key.empty() && entry.subject.empty()) entry.project.clear();  // not known
  entry.outcome = absl::StatusCodeToString(verdict.status.code());
  entry.reason = verdict.reason;
  // Unknown callers get a log of their own with a limited rate: they must not be able to rotate the
  // audit log of known ones away.
  verdict.is_known ? audit_->Write(entry) : refusals_->Write(entry);
  return verdict.status;
}

std::string Authorizer::Begin(const CallOrigin& origin, const Caller& caller,
                              const google::protobuf::Message& request) {
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  if (access == nullptr || !MayChange(*access)) return "";
  AuditEntry entry = EntryOf(origin, caller, access, request);
  entry.outcome = AuditEntry::kBegun;
  entry.call = NewAuditCall();
  audit_->WriteDurably(entry);
  return std::move(entry.call);
}

void Authorizer::Record(const CallOrigin& origin, const Caller& caller,
                        const google::protobuf::Message& request, const absl::Status& outcome,
                        const std::string& begun) {
  const MethodAccess* access = FindMethodAccess(*request.GetDescriptor());
  // Reads change nothing and are too many to record.
  if (access != nullptr && access->scope == v1::SCOPE_READ) return;
  AuditEntry entry = EntryOf(origin, caller, access, request);
  entry.outcome = absl::StatusCodeToString(outcome.code());
  entry.call = begun;
  audit_->Write(entry);
}

absl::Status Authorizer::Run(const CallOrigin& origin, const google::protobuf::Message& request,
                             absl::FunctionRef<absl::Status(const AuthorizedCaller&)> call) {
  ASSIGN_OR_RETURN(Verdict verdict, Admit(origin, request));
  absl::Status status = verdict.scenes.status();
  std::string begun;
  if (status.ok()) {
    begun = Begin(origin, verdict.caller, request);
    status = call({verdict.caller, *std::move(verdict.scenes)});
  }
  Record(origin, verdict.caller, request, status, begun);
  return status;
}

}  // namespace pepeseg
