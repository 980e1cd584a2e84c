#pragma once

#include <filesystem>
#include <string>

namespace pepeseg {

// Who may reach a listener, and what it shows of itself.
struct AccessOptions {
  // PEM files; read again when they change, for connections made from then on. Both or none: none
  // is a listener without encryption.
  std::filesystem::path tls_certificate;  // chain, the server's first
  std::filesystem::path tls_key;
  // PEM bundle of those who may sign clients' certificates; given, every client must have one.
  std::filesystem::path tls_client_ca;
  // Calls must carry a key of theirs (proto/pepeseg/v1/access.proto). Without it everybody may do
  // everything, in the project "default".
  bool require_keys = false;
  // Name (CN, or one of the alternative names) in a client's certificate: who has that says who
  // calls by metadata (access.proto). Needs keys and a client CA. Empty: nobody may.
  std::string trusted_gateway;
};

}  // namespace pepeseg
