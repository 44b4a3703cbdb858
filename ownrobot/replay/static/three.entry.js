// What three.min.js is made of: npm install three@0.160.1 esbuild@0.24.0, then
// npx esbuild three.entry.js --bundle --minify --format=iife --global-name=THREE --outfile=three.min.js
export {
  BoxGeometry, BufferAttribute, BufferGeometry, CatmullRomCurve3, Color, Curve, CylinderGeometry, DirectionalLight, DoubleSide, ExtrudeGeometry, Fog, Group,
  HemisphereLight, Mesh, MeshBasicMaterial, MeshLambertMaterial, Path, PerspectiveCamera, Quaternion, Scene, Shape, Sphere, TubeGeometry, Vector3,
  WebGLRenderer,
} from "three";
