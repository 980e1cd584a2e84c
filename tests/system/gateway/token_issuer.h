#pragma once

#include <openssl/evp.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <string>

namespace pepeseg::testing {

// Signs JSON Web Tokens with an RSA key that is made for one run of a test.
class TokenIssuer {
 public:
  static constexpr char kIssuer[] = "https://issuer.example.org";
  static constexpr char kAudience[] = "pepeseg";

  TokenIssuer();

  const std::string& public_key() const { return public_key_; }  // PEM
  // What the gateway of GatewayProcess lets through for ten minutes.
  static nlohmann::json Claims(const std::string& project, const std::string& scope);
  // RS256.
  std::string Sign(const nlohmann::json& claims) const;
  // A token of these parts, which are encoded here; `signature` is bytes.
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
