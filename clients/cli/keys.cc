// The verbs for keys of a server that demands them. They speak to its admin listener, not to
// --server.
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/admin_verb.h"
#include "clients/cli/shell.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

struct KeyFlags {
  std::string admin;
  std::string project;
  std::vector<std::string> scopes;
  std::string name;
  int expires_days = 0;  // 0: never
  std::string key;
};

using Stub = v1::AdminService::Stub;

std::string KeyLine(const v1::ApiKey& key) {
  std::vector<std::string> scopes;
  for (const int scope : key.scopes()) {
    // "SCOPE_READ": without its first word.
    scopes.push_back(absl::AsciiStrToLower(v1::Scope_Name(scope).substr(6)));
  }
  const int64_t now = absl::ToUnixSeconds(absl::Now());
  const bool expired = key.has_expire_time() && key.expire_time().seconds() <= now;
  const char* state = key.has_revoke_time() ? "revoked" : expired ? "expired" : "valid";
  return absl::StrFormat("%s  %-16s  %-24s  %-8s \"%s\"", key.name(), key.project(),
                         absl::StrJoin(scopes, ","), state, key.display_name());
}

absl::Status RunCreate(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  v1::CreateKeyRequest request;
  request.set_project(flags.project);
  request.set_display_name(flags.name);
  for (const std::string& word : flags.scopes) {
    v1::Scope scope = v1::SCOPE_UNSPECIFIED;
    v1::Scope_Parse(absl::StrCat("SCOPE_", absl::AsciiStrToUpper(word)), &scope);
    request.add_scopes(scope);
  }
  if (flags.expires_days > 0) {
    const absl::Time end = absl::Now() + absl::Hours(24 * flags.expires_days);
    request.mutable_expire_time()->set_seconds(absl::ToUnixSeconds(end));
  }
  v1::CreateKeyResponse answer;
  Call call("", kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.CreateKey(call, request, &answer)));
  if (shell.json) {
    PrintJson(answer);
    return absl::OkStatus();
  }
  Note(absl::StrCat(KeyLine(answer.key()), "\nIts secret is not shown again:"));
  Print(answer.secret());
  return absl::OkStatus();
}

absl::Status RunList(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  v1::ListKeysRequest request;
  request.set_project(flags.project);
  ASSIGN_OR_RETURN(const v1::ListKeysResponse all,
                   AskAllPages(admin, &Stub::ListKeys, "", request));
  for (const v1::ApiKey& key : all.keys()) shell.json ? PrintJson(key) : Print(KeyLine(key));
  return absl::OkStatus();
}

absl::Status RunRevoke(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  v1::RevokeKeyRequest request;
  request.set_name(absl::StartsWith(flags.key, "keys/") ? flags.key
                                                        : absl::StrCat("keys/", flags.key));
  v1::ApiKey answer;
  Call call("", kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.RevokeKey(call, request, &answer)));
  shell.json ? PrintJson(answer) : Print(KeyLine(answer));
  return absl::OkStatus();
}

}  // namespace

void AddKeys(CLI::App& app, Shell& shell) {
  const auto made = std::make_shared<KeyFlags>(), listed = std::make_shared<KeyFlags>(),
             revoked = std::make_shared<KeyFlags>();
  CLI::App& create = AddAdminVerb<KeyFlags>(
      app, shell, {"key-create", "Make an API key and print its secret, once"}, {made, RunCreate});
  create.add_option("PROJECT", made->project, "Whose scenes it opens; made when it is new")
      ->required();
  create.add_option("--scopes", made->scopes, "Of read, write, train, operate; with ','")
      ->delimiter(',')
      ->check(CLI::IsMember({"read", "write", "train", "operate"}))
      ->required();
  create.add_option("--name", made->name, "For people");
  constexpr int kMaxDays = 100 * 365;
  create.add_option("--expires-days", made->expires_days, "Without it the key does not expire")
      ->check(CLI::Range(1, kMaxDays));
  AddAdminVerb<KeyFlags>(app, shell, {"key-list", "List API keys, without their secrets"},
                         {listed, RunList})
      .add_option("--project", listed->project, "Of this one only");
  AddAdminVerb<KeyFlags>(app, shell, {"key-revoke", "From now on an API key opens nothing"},
                         {revoked, RunRevoke})
      .add_option("KEY", revoked->key, "As key-list prints it")
      ->required();
}

}  // namespace pepeseg::client::cli
