/** esbuild bundles these; TypeScript need only know that they exist. */
declare module "*.css";
