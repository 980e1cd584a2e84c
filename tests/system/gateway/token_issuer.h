#pragma once

#include <openssl/evp.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

namespace pepeseg::testing {

// Signs JSON Web Tokens with a new RSA key.
class TokenIssuer {
 public:
  static constexpr char kIssuer[] = "https://issuer.example.org";
  static constexpr char kAudience[] = "pepeseg";

  TokenIssuer();

  const std::string& public_key() const { return public_key_; }  // PEM
  // Returns claims that the fleet's gateway accepts for ten minutes.
  static nlohmann::json Claims(const std::string& project, const std::string& scope);
  // Returns a token with these claims, signed by RS256.
  std::string Sign(const nlohmann::json& claims) const;
  // Encodes the parts and joins them to a token. `signature`: raw bytes.
  static std::string Assemble(const std::string& header, const std::string& payload,
                              const std::string& signature);
  std::string Signature(const std::string& header, const std::string& payload) const;

 private:
  struct Free {
    void operator()(EVP_PKEY* key) const { EVP_PKEY_free(key); }
  };
  std::unique_ptr<EVP_PKEY, Free> key_;
  std::string public_key_;
};

}  // namespace pepeseg::testing
