// A scene in space that can be turned: the twin of report/svg/scene.rs.
const SVG='http://www.w3.org/2000/svg';
function node(parent,name,attributes,text){
  const n=document.createElementNS(SVG,name);
  for(const[k,v]of Object.entries(attributes))n.setAttribute(k,v);
  if(text!==undefined)n.textContent=text;
  parent.append(n);return n;
}
class SceneView{
  constructor(figure,panel,host){
    this.figure=figure;this.panel=panel;this.host=host;this.scene=panel.marks[0].scene;
    this.yaw=.7;this.pitch=.35;this.size=1;this.hidden=new Set();
    this.svg=node(host,'svg',{role:'img','aria-label':figure.title+': drag or arrow keys turn it'});
    this.svg.classList.add('turned');
    this.svg.addEventListener('pointerdown',e=>{
      this.svg.setPointerCapture(e.pointerId);
      let[x,y]=[e.clientX,e.clientY];
      const move=m=>{this.turn((m.clientX-x)*.01,(m.clientY-y)*.01);[x,y]=[m.clientX,m.clientY]};
      const up=()=>{this.svg.removeEventListener('pointermove',move);this.svg.removeEventListener('pointerup',up)};
      this.svg.addEventListener('pointermove',move);this.svg.addEventListener('pointerup',up);
    });
    this.svg.addEventListener('wheel',e=>{
      if(!e.ctrlKey&&!host.closest('figure').contains(document.activeElement))return;
      e.preventDefault();this.zoom(e.deltaY<0?1.15:1/1.15);
    },{passive:false});
    this.svg.addEventListener('dblclick',()=>this.whole());
    new ResizeObserver(()=>this.redraw()).observe(host);
    this.redraw();
  }
  turn(yaw,pitch){this.yaw+=yaw;this.pitch=Math.max(-1.55,Math.min(1.55,this.pitch+pitch));this.redraw()}
  zoom(by){this.size=Math.max(.2,Math.min(20,this.size*by));this.redraw()}
  whole(){this.yaw=.7;this.pitch=.35;this.size=1;this.redraw()}
  along(axis){[this.yaw,this.pitch]=axis==='x'?[0,0]:axis==='y'?[0,1.55]:[Math.PI/2,0];this.redraw()}
  key(e){
    const act={ArrowLeft:()=>this.turn(-.1,0),ArrowRight:()=>this.turn(.1,0),ArrowUp:()=>this.turn(0,.1),ArrowDown:()=>this.turn(0,-.1),'+':()=>this.zoom(1.2),'-':()=>this.zoom(1/1.2),0:()=>this.whole(),x:()=>this.along('x'),y:()=>this.along('y'),z:()=>this.along('z')}[e.key];
    if(act)act();
    return!!act;
  }
  seen([x,y,z]){
    const cy=Math.cos(this.yaw),sy=Math.sin(this.yaw),cp=Math.cos(this.pitch),sp=Math.sin(this.pitch);
    const right=z*cy-x*sy,near=z*sy+x*cy;
    return[right,-(y*cp-near*sp),y*sp+near*cp];
  }
  corners(b){return Array.from({length:8},(_,i)=>[0,1,2].map(a=>i>>a&1?b.high[a]:b.low[a]))}
  redraw(){
    const w=this.host.clientWidth||600,h=Math.max(320,Math.min(460,.8*w)),svg=this.svg;
    svg.replaceChildren();
    svg.setAttribute('viewBox',`0 0 ${w} ${h}`);
    const all=[...this.scene.bodies.flatMap(b=>this.corners(b)),...this.scene.spots.map(s=>s.at)];
    const middle=[0,1,2].map(a=>(Math.min(...all.map(p=>p[a]))+Math.max(...all.map(p=>p[a])))/2);
    const reach=Math.max(1e-3,...all.map(p=>Math.hypot(...p.map((v,a)=>v-middle[a]))));
    const size=this.size*Math.min(w-90,h)/2/reach*.98,off=this.seen(middle);
    const at=p=>{const s=this.seen(p);return[w/2+size*(s[0]-off[0]),h/2+size*(s[1]-off[1]),s[2]]};
    const line=(a,b,cls,width)=>node(svg,'line',{x1:a[0].toFixed(1),y1:a[1].toFixed(1),x2:b[0].toFixed(1),y2:b[1].toFixed(1),class:cls,'stroke-width':width});
    for(const b of this.scene.bodies){
      const c=this.corners(b).map(at);
      for(let i=0;i<8;i++)for(const bit of[1,2,4])if(!(i&bit))line(c[i],c[i|bit],'s-'+b.role,.7);
    }
    for(const[name,d]of[['x',[1,0,0]],['y',[0,1,0]],['z',[0,0,1]]]){
      const s=this.seen(d),o=[46,h-46],e=[o[0]+34*s[0],o[1]+34*s[1]];
      line(o,e,'frame',1.4);node(svg,'text',{x:e[0]+4*Math.sign(s[0]),y:e[1]-4,class:'label','text-anchor':'middle'},name);
    }
    const taken=[];
    const spots=[...this.scene.spots].map(s=>[s,at(s.at)]).sort((a,b)=>a[1][2]-b[1][2]);
    for(const[s,p]of spots){
      if(s.toward)line(at(s.at.map((v,i)=>v-.014*s.toward[i])),p,'s-'+s.role,2);
      if(s.toward)node(svg,'circle',{cx:p[0],cy:p[1],r:4,class:`f-${s.role} s-${s.role}`});
      else node(svg,'rect',{x:p[0]-4,y:p[1]-4,width:8,height:8,class:`paper s-${s.role}`,'stroke-width':1.4});
    }
    for(const[s,p]of[...spots].reverse()){
      const width=6.8*[...s.name].length;
      const free=[[7,-5],[7,14],[-7-width,-5],[-7-width,14],[7,-17],[7,26]].map(d=>[p[0]+d[0],p[1]+d[1]]).find(([x,y])=>x>0&&x+width<w&&taken.every(t=>x+width<t[0]||x>t[2]||y+2<t[1]||y-12>t[3]));
      if(!free)continue;
      taken.push([free[0],free[1]-12,free[0]+width,free[1]+2]);
      node(svg,'text',{x:free[0].toFixed(1),y:free[1].toFixed(1),class:'tick'},s.name);
    }
    this.drawn=(this.drawn||0)+1;
  }
}
