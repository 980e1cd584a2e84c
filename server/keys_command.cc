#include "server/keys_command.h"

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <utility>

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
  int expires_days = 0;  // 0: never
};

// The database, and what it stands in. The lock is only for a directory that nobody serves: a
// running server holds it, and SQLite lets a second process write beside it.
struct OpenDatabase {
  std::unique_ptr<DirectoryLock> lock;
  std::unique_ptr<Store> store;
  std::unique_ptr<AuditLog> audit;
};

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

AuditEntry EntryOf(const std::string& verb, const KeyRow& key) {
  AuditEntry entry;
  entry.peer = "command line";
  entry.method = absl::StrCat("pepesegd keys ", verb);
  entry.resources = {absl::StrCat("keys/", key.id), key.project};
  entry.outcome = "OK";
  return entry;
}

absl::Status Create(const ServerOptions& server, const NewKeyFlags& flags) {
  ASSIGN_OR_RETURN(NewKey key, MakeKey());
  key.row.project = flags.project;
  key.row.display_name = flags.name;
  ASSIGN_OR_RETURN(key.row.scopes, ScopesFromText(flags.scopes));
  if (flags.expires_days > 0) {
    key.row.expire_time = absl::Now() + absl::Hours(24 * flags.expires_days);
  }
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  ASSIGN_OR_RETURN(const KeyRow made, database.store->keys().CreateKey(key.row));
  database.audit->Write(EntryOf("create", made));
  absl::FPrintF(stderr, "keys/%s of project %s may %s. Its secret is not shown again:\n", made.id,
                made.project, ScopesToText(made.scopes));
  absl::PrintF("%s\n", key.secret);
  return absl::OkStatus();
}

std::string StateOf(const KeyRow& key) {
  if (IsRevoked(key)) return "revoked";
  if (IsExpired(key, absl::Now())) return "expired";
  if (key.expire_time == absl::InfinitePast()) return "valid";
  return absl::StrCat("valid until ",
                      absl::FormatTime("%Y-%m-%d", key.expire_time, absl::UTCTimeZone()));
}

absl::Status List(const ServerOptions& server) {
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  PageRequest page{1000, ""};
  do {
    ASSIGN_OR_RETURN(const Page<KeyRow> keys, database.store->keys().ListKeys("", page));
    for (const KeyRow& key : keys.rows) {
      absl::PrintF("keys/%s  %-16s  %-24s  %-22s  \"%s\"\n", key.id, key.project,
                   ScopesToText(key.scopes), StateOf(key), key.display_name);
    }
    page.page_token = keys.next_page_token;
  } while (!page.page_token.empty());
  return absl::OkStatus();
}

absl::Status Revoke(const ServerOptions& server, const std::string& name) {
  ASSIGN_OR_RETURN(const OpenDatabase database, Open(server));
  ASSIGN_OR_RETURN(const KeyRow key,
                   database.store->keys().RevokeKey(std::string(absl::StripPrefix(name, "keys/"))));
  database.audit->Write(EntryOf("revoke", key));
  absl::PrintF("keys/%s of project %s opens nothing any more\n", key.id, key.project);
  return absl::OkStatus();
}

void AddCreate(CLI::App& keys, const ServerOptions& server,
               std::function<absl::Status()>& command) {
  constexpr int kMaxDays = 100 * 365;
  constexpr size_t kMaxNameBytes = 256;
  const auto flags = std::make_shared<NewKeyFlags>();
  CLI::App* create = keys.add_subcommand("create", "Make a key and print its secret, once");
  create->fallthrough();
  create->add_option("--project", flags->project, "Whose scenes it opens; made when it is new")
      ->required();
  create->add_option("--scopes", flags->scopes, "Of read, write, train, operate; with ','")
      ->required();
  create->add_option("--name", flags->name, "For people")->check([](const std::string& name) {
    return name.size() <= kMaxNameBytes ? "" : "over 256 bytes";
  });
  create->add_option("--expires-days", flags->expires_days, "Without it the key does not expire")
      ->check(CLI::Range(1, kMaxDays));
  create->callback([flags, &server, &command] {
    command = [flags, &server] { return Create(server, *flags); };
  });
}

}  // namespace

void AddKeysCommand(CLI::App& app, const ServerOptions& server,
                    std::function<absl::Status()>& command) {
  CLI::App* keys = app.add_subcommand("keys", "Make, list and revoke API keys, then end");
  keys->fallthrough();  // to --data and --database
  keys->require_subcommand(1);
  AddCreate(*keys, server, command);
  CLI::App* list = keys->add_subcommand("list", "All keys, without their secrets");
  list->fallthrough();
  list->callback([&server, &command] { command = [&server] { return List(server); }; });
  CLI::App* revoke = keys->add_subcommand("revoke", "From now on the key opens nothing");
  revoke->fallthrough();
  const auto name = std::make_shared<std::string>();
  revoke->add_option("KEY", *name, "Its name, as list prints it")->required();
  revoke->callback(
      [name, &server, &command] { command = [name, &server] { return Revoke(server, *name); }; });
}

}  // namespace pepeseg
