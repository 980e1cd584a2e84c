#include "server/keys_command.h"

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "core/base/status_macros.h"
#include "server/access/api_key.h"
#include "server/access/audit_log.h"
#include "server/data/locked_file.h"
#include "server/store/layout.h"
#include "server/store/store.h"

namespace pepeseg {
namespace {

struct NewKeyFlags {
  std::string project;
  std::string scopes;
  std::string name;
  int expires_days = 0;  // days until the key expires; 0: never
};

// The database and the audit log. `lock` is held only if no server runs on the data directory. A
// running server holds it; SQLite lets a second process write at the same time.
struct OpenDatabase {
  std::unique_ptr<DirectoryLock> lock;
  std::unique_ptr<Store> store;
  std::unique_ptr<AuditLog> audit;
};

// Opens the database that the flags name.
absl::StatusOr<OpenDatabase> Open(const ServerOptions& server) {
  OpenDatabase opened;
  const bool shared = server.database.starts_with("postgresql:");
  absl::StatusOr<std::unique_ptr<DirectoryLock>> lock = DirectoryLock::Take(server.data, shared);
  if (lock.ok()) {
    opened.lock = *std::move(lock);
  } else if (!absl::IsFailedPrecondition(lock.status())) {
    return lock.status();
  }
  const std::string url = server.database.empty()
                              ? absl::StrCat("sqlite:", DatabasePath(server.data).string())
                              : server.database;
  ASSIGN_OR_RETURN(opened.store, Store::Open(url));
  ASSIGN_OR_RETURN(opened.audit, AuditLog::Open(AuditPath(server.data), {}));
  return opened;
}

// Makes a change to a key, with a line in the audit log before and after it.
absl::StatusOr<KeyRecord> Change(AuditLog& audit, const std::string& verb,
                                 const std::vector<std::string>& resources,
                                 absl::FunctionRef<absl::StatusOr<KeyRecord>()> change) {
  AuditEntry entry;
  entry.peer = "command line";
  entry.method = absl::StrCat("pepesegd keys ", verb);
  entry.resources = resources;
  entry.outcome = AuditEntry::kBegun;
  entry.call = NewAuditCall();
  audit.WriteDurably(entry);
  absl::StatusOr<KeyRecord> key = change();
  entry.outcome = absl::StatusCodeToString(key.status().code());
  if (key.ok()) entry.resources = {absl::StrCat("keys/", key->id), key->project};
  audit.Write(entry);
  return key;
}

// Creates a key. The secret goes to standard output and everything else to standard error, so that
// a script can capture the secret.
absl::Status Create(const ServerOptions& server, const NewKeyFlags& flags) {
  ASSIGN_OR_RETURN(NewKey key, MakeKey());
  key.record.project = flags.project;
  key.record.display_name = flags.name;
  ASSIGN_OR_RETURN(key.record.scopes, ScopesFromText(flags.scopes));
  if (flags.expires_days > 0) {
    key.record.expire_time = absl::Now() + absl::Hours(24 * flags.expires_days);
  }
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  ASSIGN_OR_RETURN(
      const KeyRecord made,
      Change(*database.audit, "create", {absl::StrCat("keys/", key.record.id), key.record.project},
             [&] { return database.store->keys().CreateKey(key.record); }));
  absl::FPrintF(stderr, "keys/%s of project %s may %s. Its secret is not shown again:\n", made.id,
                made.project, ScopesToText(made.scopes));
  absl::PrintF("%s\n", key.secret);
  return absl::OkStatus();
}

// Returns whether the key is valid, until when, or why not.
std::string StateOf(const KeyRecord& key) {
  if (IsRevoked(key)) return "revoked";
  if (IsExpired(key, absl::Now())) return "expired";
  if (key.expire_time == absl::InfinitePast()) return "valid";
  return absl::StrCat("valid until ",
                      absl::FormatTime("%Y-%m-%d", key.expire_time, absl::UTCTimeZone()));
}

// Prints all keys page by page.
absl::Status List(const ServerOptions& server) {
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  PageRequest page{1000, ""};
  do {
    ASSIGN_OR_RETURN(const Page<KeyRecord> keys, database.store->keys().ListKeys("", page));
    for (const KeyRecord& key : keys.records) {
      absl::PrintF("keys/%s  %-16s  %-24s  %-22s  \"%s\"\n", key.id, key.project,
                   ScopesToText(key.scopes), StateOf(key), key.display_name);
    }
    page.page_token = keys.next_page_token;
  } while (!page.page_token.empty());
  return absl::OkStatus();
}

absl::Status Revoke(const ServerOptions& server, const std::string& name) {
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  const std::string id(absl::StripPrefix(name, "keys/"));
  ASSIGN_OR_RETURN(const KeyRecord key,
                   Change(*database.audit, "revoke", {absl::StrCat("keys/", id)},
                          [&] { return database.store->keys().RevokeKey(id); }));
  absl::PrintF("keys/%s of project %s is revoked\n", key.id, key.project);
  return absl::OkStatus();
}

void AddCreate(CLI::App& keys, const ServerOptions& server,
               std::function<absl::Status()>& command) {
  constexpr int kMaxDays = 100 * 365;
  constexpr size_t kMaxNameBytes = 256;
  const auto flags = std::make_shared<NewKeyFlags>();
  CLI::App* create = keys.add_subcommand("create", "Create a key and print its secret, once");
  create->fallthrough();
  create
      ->add_option("--project", flags->project,
                   "Project whose scenes the key gives access to; created if it is new")
      ->required();
  create
      ->add_option("--scopes", flags->scopes,
                   "Scopes of the key, separated by ',': read, write, train, operate")
      ->required();
  create->add_option("--name", flags->name, "Name of the key, shown by list")
      ->check([](const std::string& name) {
        return name.size() <= kMaxNameBytes ? "" : "over 256 bytes";
      });
  create
      ->add_option("--expires-days", flags->expires_days,
                   "Days until the key expires; without it the key does not expire")
      ->check(CLI::Range(1, kMaxDays));
  create->callback([flags, &server, &command] {
    command = [flags, &server] { return Create(server, *flags); };
  });
}

}  // namespace

void AddKeysCommand(CLI::App& app, const ServerOptions& server,
                    std::function<absl::Status()>& command) {
  CLI::App* keys = app.add_subcommand("keys", "Create, list or revoke API keys, and exit");
  keys->fallthrough();  // so that --data and --database may follow the command
  keys->require_subcommand(1);
  AddCreate(*keys, server, command);
  CLI::App* list = keys->add_subcommand("list", "List all keys, without their secrets");
  list->fallthrough();
  list->callback([&server, &command] { command = [&server] { return List(server); }; });
  CLI::App* revoke = keys->add_subcommand("revoke", "Revoke a key");
  revoke->fallthrough();
  const auto name = std::make_shared<std::string>();
  revoke->add_option("KEY", *name, "Name of the key, as list prints it")->required();
  revoke->callback(
      [name, &server, &command] { command = [name, &server] { return Revoke(server, *name); }; });
}

}  // namespace pepeseg
