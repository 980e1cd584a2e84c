// The admin verbs about projects: "key-create", "key-list", "key-revoke" and "quota".
#include <google/protobuf/descriptor.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "absl/time/clock.h"
#include "absl/time/time.h"
#include "clients/cli/admin_verb.h"
#include "clients/cli/verbs.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
#include "clients/terminal/shell.h"
#include "clients/terminal/text_table.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

struct KeyFlags {
  std::string admin;  // address of the admin listener
  std::string project;
  std::vector<std::string> scopes;
  std::string name;      // display name
  int expires_days = 0;  // 0: the key never expires
  std::string key;       // to be described or revoked; empty: list all
};

using Stub = v1::AdminService::Stub;

// Returns "keys/0123456789abcdef  PROJECT  SCOPES  STATE  "NAME"".
std::string KeyLine(const v1::ApiKey& key) {
  std::vector<std::string> scopes;
  for (const int scope : key.scopes()) {
    scopes.push_back(WordOf(static_cast<v1::Scope>(scope)));
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

// Returns "keys/ID" for an id or a name.
std::string KeyName(const std::string& key) {
  return absl::StartsWith(key, "keys/") ? key : absl::StrCat("keys/", key);
}

absl::Status DescribeKey(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  v1::GetKeyRequest request;
  request.set_name(KeyName(flags.key));
  ASSIGN_OR_RETURN(const v1::ApiKey key, Ask(admin, &Stub::GetKey, "", request));
  shell.json ? PrintJson(key) : Print(KeyLine(key));
  return absl::OkStatus();
}

absl::Status RunList(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  if (!flags.key.empty()) return DescribeKey(shell, flags, admin);
  v1::ListKeysRequest request;
  request.set_project(flags.project);
  ASSIGN_OR_RETURN(const v1::ListKeysResponse all,
                   AskAllPages(admin, &Stub::ListKeys, "", request));
  for (const v1::ApiKey& key : all.keys()) shell.json ? PrintJson(key) : Print(KeyLine(key));
  return absl::OkStatus();
}

absl::Status RunRevoke(const Shell& shell, const KeyFlags& flags, Stub& admin) {
  v1::RevokeKeyRequest request;
  request.set_name(KeyName(flags.key));
  v1::ApiKey answer;
  Call call("", kCallSeconds);
  RETURN_IF_ERROR(FromGrpc(admin.RevokeKey(call, request, &answer)));
  shell.json ? PrintJson(answer) : Print(KeyLine(answer));
  return absl::OkStatus();
}

struct QuotaFlags {
  std::string admin;  // address of the admin listener
  std::string project;
  std::vector<std::string> settings;  // "stored_bytes=1000"; empty: print the quota
};

// Returns the fields of Quota in the order of the contract; all are int64.
std::vector<const google::protobuf::FieldDescriptor*> QuotaFields() {
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  const google::protobuf::Descriptor& type = *v1::Quota::descriptor();
  for (int i = 0; i < type.field_count(); ++i) fields.push_back(type.field(i));
  return fields;
}

// Sets a field of `quota` from "NAME=NUMBER". INVALID_ARGUMENT: the name is unknown, or the number
// is malformed or negative.
absl::Status ApplySetting(const std::string& setting, v1::Quota& quota) {
  const std::pair<std::string, std::string> parts =
      absl::StrSplit(setting, absl::MaxSplits('=', 1));
  int64_t value = 0;
  if (!absl::SimpleAtoi(parts.second, &value) || value < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--set ", setting, ": expected NAME=NUMBER with a number of at least 0"));
  }
  std::string names;
  for (const auto* field : QuotaFields()) {
    absl::StrAppend(&names, names.empty() ? "" : ", ", field->name());
    if (field->name() != parts.first) continue;
    quota.GetReflection()->SetInt64(&quota, field, value);
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("--set ", setting, ": unknown name; the names are ", names));
}

// Prints a line "stored_bytes  USED  of LIMIT" for each field.
void PrintUsage(const v1::ProjectUsage& usage) {
  for (const auto* field : QuotaFields()) {
    const int64_t used = usage.used().GetReflection()->GetInt64(usage.used(), field);
    const int64_t limit = usage.quota().GetReflection()->GetInt64(usage.quota(), field);
    const std::string of = limit == 0 ? "no limit" : absl::StrCat("of ", limit);
    Print(absl::StrFormat("%-19s %15d  %s", field->name(), used, of));
  }
}

absl::Status RunQuota(const Shell& shell, const QuotaFlags& flags, Stub& admin) {
  v1::ProjectUsage usage;
  Call call("", kCallSeconds);
  if (flags.settings.empty()) {
    v1::GetProjectUsageRequest request;
    request.set_project(flags.project);
    RETURN_IF_ERROR(FromGrpc(admin.GetProjectUsage(call, request, &usage)));
  } else {
    v1::UpdateQuotaRequest request;
    request.set_project(flags.project);
    for (const std::string& setting : flags.settings) {
      RETURN_IF_ERROR(ApplySetting(setting, *request.mutable_quota()));
    }
    RETURN_IF_ERROR(FromGrpc(admin.UpdateQuota(call, request, &usage)));
  }
  shell.json ? PrintJson(usage) : PrintUsage(usage);
  return absl::OkStatus();
}

}  // namespace

void AddKeys(CLI::App& app, Shell& shell) {
  const auto made = std::make_shared<KeyFlags>(), listed = std::make_shared<KeyFlags>(),
             revoked = std::make_shared<KeyFlags>();
  CLI::App& create = AddAdminVerb<KeyFlags>(
      app, shell, {"key-create", "Create an API key and print its secret, once"},
      {made, RunCreate});
  create
      .add_option("PROJECT", made->project,
                  "Project whose scenes the key gives access to; created if it is new")
      ->required();
  create
      .add_option("--scopes", made->scopes,
                  "What the key permits: read, write, train, operate; separated by commas")
      ->delimiter(',')
      ->check(CLI::IsMember({"read", "write", "train", "operate"}))
      ->required();
  create.add_option("--name", made->name, "Display name of the key");
  constexpr int kMaxDays = 100 * 365;
  create
      .add_option("--expires-days", made->expires_days,
                  "Days until the key expires; by default it does not expire")
      ->check(CLI::Range(1, kMaxDays));
  CLI::App& list = AddAdminVerb<KeyFlags>(
      app, shell, {"key-list", "List API keys, or describe one, without their secrets"},
      {listed, RunList});
  CLI::Option* key = list.add_option("KEY", listed->key, "Name of a key");
  list.add_option("--project", listed->project, "Only the keys of this project")->excludes(key);
  AddAdminVerb<KeyFlags>(app, shell, {"key-revoke", "Revoke an API key, at once"},
                         {revoked, RunRevoke})
      .add_option("KEY", revoked->key, "Name of the key, as key-list prints it")
      ->required();
}

void AddQuota(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<QuotaFlags>();
  CLI::App& verb = AddAdminVerb<QuotaFlags>(
      app, shell, {"quota", "Print, or set, the quota of a project"}, {flags, RunQuota});
  verb.add_option("PROJECT", flags->project, "Name of the project; it need not have a key yet")
      ->required();
  verb.add_option("--set", flags->settings,
                  "NAME=NUMBER, once or more: stored_bytes, open_uploads, queued_jobs, "
                  "running_jobs, queries_per_second, resident_bytes. Names that are not given, and "
                  "0, get the server's defaults");
}

}  // namespace pepeseg::client::cli
