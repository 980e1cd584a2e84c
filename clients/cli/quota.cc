// The verb for what a project may take and takes. It speaks to the admin listener, not to --server.
#include <google/protobuf/descriptor.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "clients/cli/shell.h"
#include "clients/cpp/answer_status.h"
#include "clients/cpp/call.h"
#include "clients/cpp/status_macros.h"
#include "pepeseg/v1/admin_service.grpc.pb.h"

namespace pepeseg::client::cli {
namespace {

struct QuotaFlags {
  std::string admin;
  std::string project;
  std::vector<std::string> settings;  // "stored_bytes=1000"
};

// In the order of the contract.
std::vector<const google::protobuf::FieldDescriptor*> QuotaFields() {
  std::vector<const google::protobuf::FieldDescriptor*> fields;
  const google::protobuf::Descriptor& type = *v1::Quota::descriptor();
  for (int i = 0; i < type.field_count(); ++i) fields.push_back(type.field(i));
  return fields;
}

absl::Status ApplySetting(const std::string& setting, v1::Quota& quota) {
  const std::pair<std::string, std::string> parts =
      absl::StrSplit(setting, absl::MaxSplits('=', 1));
  int64_t value = 0;
  if (!absl::SimpleAtoi(parts.second, &value) || value < 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("--set ", setting, ": must be NAME=NUMBER, the number at least 0"));
  }
  std::string names;
  for (const auto* field : QuotaFields()) {
    absl::StrAppend(&names, names.empty() ? "" : ", ", field->name());
    if (field->name() != parts.first) continue;
    quota.GetReflection()->SetInt64(&quota, field, value);
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(absl::StrCat("--set ", setting, ": the names are ", names));
}

void PrintUsage(const v1::ProjectUsage& usage) {
  for (const auto* field : QuotaFields()) {
    const int64_t used = usage.used().GetReflection()->GetInt64(usage.used(), field);
    const int64_t limit = usage.quota().GetReflection()->GetInt64(usage.quota(), field);
    const std::string of = limit == 0 ? "no limit" : absl::StrCat("of ", limit);
    Print(absl::StrFormat("%-19s %15d  %s", field->name(), used, of));
  }
}

absl::Status RunQuota(const Shell& shell, const QuotaFlags& flags) {
  const auto admin = v1::AdminService::NewStub(shell.channel);
  v1::ProjectUsage usage;
  Call call("", kCallSeconds);
  if (flags.settings.empty()) {
    v1::GetProjectUsageRequest request;
    request.set_project(flags.project);
    RETURN_IF_ERROR(FromGrpc(admin->GetProjectUsage(call, request, &usage)));
  } else {
    v1::SetQuotaRequest request;
    request.set_project(flags.project);
    for (const std::string& setting : flags.settings) {
      RETURN_IF_ERROR(ApplySetting(setting, *request.mutable_quota()));
    }
    RETURN_IF_ERROR(FromGrpc(admin->SetQuota(call, request, &usage)));
  }
  shell.json ? PrintJson(usage) : PrintUsage(usage);
  return absl::OkStatus();
}

}  // namespace

void AddQuota(CLI::App& app, Shell& shell) {
  const auto flags = std::make_shared<QuotaFlags>();
  CLI::App* verb = app.add_subcommand("quota", "Tell, or set, what a project may take");
  verb->add_option("--admin", flags->admin,
                   "Where the server's admin service listens, host:port or unix:path")
      ->envname("PEPESEG_ADMIN")
      ->required();
  verb->add_option("PROJECT", flags->project, "Which one; it need not have a key yet")->required();
  verb->add_option("--set", flags->settings,
                   "NAME=NUMBER, once or more: of stored_bytes, open_uploads, queued_jobs, "
                   "running_jobs, queries_per_second, resident_bytes. Those that are not named, "
                   "and 0, are the server's defaults");
  verb->callback([flags, &shell] {
    shell.server = flags->admin;
    shell.verb = [&shell, flags] { return RunQuota(shell, *flags); };
  });
}

}  // namespace pepeseg::client::cli
