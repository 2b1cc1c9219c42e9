# For nixpkgs, or by hand in the repository:
#   nix-build -E '(import <nixpkgs> { }).callPackage ./tools/packaging/oscura.nix { }'
{ lib, rustPlatform }:

let
  root = ../..;
  manifest = lib.importTOML (root + "/Cargo.toml");
in
rustPlatform.buildRustPackage {
  pname = manifest.package.name;
  version = manifest.workspace.package.version;
  src = lib.cleanSource root;
  cargoLock.lockFile = root + "/Cargo.lock";
  cargoBuildFlags = [ "--package" "oscura" "--bin" "oscura" ];
  # The tests take a quarter of an hour.
  doCheck = false;

  # Manual pages, completions, the thumbnailer and licences.
  postInstall = ''
    mv "$out/bin/oscura" "$TMPDIR/oscura"
    PREFIX=$out sh tools/packaging/install.sh "$TMPDIR/oscura"
  '';

  meta = {
    description = manifest.package.description;
    license = with lib.licenses; [ mit asl20 ];
    mainProgram = "oscura";
    platforms = lib.platforms.unix;
  };
}
