// The CMIF under the cursor: which motions take part in a curve, and the arms moving against one
// another accordingly.
const MOTIONS=['x','y','z','rx','ry','rz'];
let participation;
// participation of each motion in singular value i; nothing if it is not known
function partsOf(i){
  if(participation===undefined){
    const mark=FIGURES.find(f=>f.name==='participation')?.panels[0].marks.find(m=>m.cells);
    participation=mark?unpack(mark.cells.values):null;
  }
  const parts=participation&&participation.slice(6*i,6*i+6);
  return parts&&parts.length===6?[...parts]:undefined;
}
function modeWords(chart,x,top){
  const curves=chart.marks().filter(m=>m.line);
  let best=-1,near=Infinity;
  curves.forEach((m,i)=>{
    const n=nearestOf(m.line,x),v=m.line.y[n],off=v>0?Math.abs(chart.plot.valToPos(v,'y')-top):NaN;
    if(off<near){near=off;best=i}
  });
  if(best<0)return'';
  const c=curves[best].line,n=nearestOf(c,x),number=chart.panel.marks.filter(m=>m.line).indexOf(curves[best]),parts=partsOf(number);
  moveArms(parts);
  const told=parts?' · '+parts.map((p,i)=>[p,MOTIONS[i]]).sort((a,b)=>b[0]-a[0]).map(([p,name])=>`${name} ${Math.round(100*p)} %`).join(', '):'';
  return`${sixDigits(along(c.x)(n))} Hz · singular value ${number+1}: ${sixDigits(c.y[n])} m/N${told}`;
}
let swinging=0;
// the scenes that show the arms: figure 4, and the small one below the CMIF
const scenes=()=>[...alive.values()].flat().filter(c=>c instanceof SceneView).concat(small||[]);
let small;
function moveArms(parts){
  // the largest motion is scaled to the available space
  const most=parts&&Math.max(...parts),motion=most>0?parts.map(p=>p/most):undefined;
  for(const s of scenes())s.motion=motion;
  if(swinging||!parts||matchMedia('(prefers-reduced-motion: reduce)').matches){for(const s of scenes())s.redraw();return}
  const begun=performance.now();
  const step=now=>{
    const time=(now-begun)/1e3,on=time<6;
    for(const s of scenes()){s.swing=on?Math.cos(2*Math.PI*time/1.5):1;s.redraw()}
    swinging=on?requestAnimationFrame(step):0;
  };
  swinging=requestAnimationFrame(step);
}
// a small picture of the arms below the CMIF
function armsBelow(element){
  const scene=FIGURES.find(f=>f.name==='geometry')?.panels[0].marks[0].scene;
  if(small||!scene||!scene.bodies.length)return;
  const box=document.createElement('div'),host=document.createElement('div'),words=document.createElement('p');
  box.className='arms';host.className='plot alive';
  words.textContent='Point at a curve, or at the matrix below: the arms move in its motions, each as large as its contribution; signs are not shown.';
  box.append(host,words);
  element.querySelector('.panels').after(box);
  small=new SceneView({title:'The arms'},{marks:[{scene:{bodies:scene.bodies,spots:[]}}]},host,190);
}
